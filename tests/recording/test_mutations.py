"""No damage to a file crashes, hangs or fills the memory, and none passes for data that it is not."""

import dataclasses
import json
import os
import resource
import signal
import struct
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mutated
import numpy as np
import pytest
import zstandard
from repository import REPOSITORY

from twin.episode import Episode
from twin.errors import InputError
from twin.recording import endotwin_pb2 as schema
from twin.recording import read_episode, read_metadata, recover_episode

LONGEST = 5.0  # [s] of the processor, for one reading of a file: a busy machine is no fault of the file
MOST_MEMORY = 2**31  # [bytes]


SPENT: list[float] = []
"""Time of the processor that each reading took [s]."""


class TooSlowError(BaseException):
    """Not an `Exception`, which the reader could take for a fault of the file."""


def alarm(*_: Any) -> None:
    raise TooSlowError(f"took more than {LONGEST} s")


def read(function: Callable, path: Path) -> tuple[Any, str]:
    """What a function returns, and what it says instead: one line that begins with the name of the file."""
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    begin = time.process_time()
    try:
        return function(path), ""
    except ValueError as error:
        kind, text = type(error), str(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        SPENT.append(time.process_time() - begin)
    assert kind is InputError
    assert text.startswith(f"{path} ")
    assert len(text.splitlines()) == 1
    assert len(text) < 1000
    return None, text


def check_valid(episode: Episode) -> None:
    """Its arrays belong together, and its metadata can be written."""
    dataclasses.replace(episode)  # refuses what an episode may not be
    count = len(episode.time)
    for field in dataclasses.fields(episode):
        if field.name not in ("metadata", "attachments"):
            values = getattr(episode, field.name)
            assert values.dtype == np.float64
            assert values.ndim >= 1
            assert len(values) in (0, count)
    assert episode.wire_tension.shape[1] in (2, 4)
    json.dumps(episode.metadata, allow_nan=False)


def check_same_samples(episode: Episode, original: Episode) -> None:
    """Every sample is one of the original, bit for bit as it was read, whatever is missing around it."""
    places = np.searchsorted(original.time, episode.time)
    for field in dataclasses.fields(episode):
        if field.name in ("metadata", "attachments"):
            continue
        values, wanted = getattr(episode, field.name), getattr(original, field.name)
        if values.size > 0:
            np.testing.assert_allclose(values, wanted[places], rtol=1e-12, atol=0, err_msg=field.name)


def check_file(path: Path, original: Episode | None) -> str:
    """Read a file in all ways; say how that ended. `original`: what any sample of it must be a sample of."""
    episode, refused = read(read_episode, path)
    metadata, unvouched = read(read_metadata, path)
    recovered, lost = read(recover_episode, path)
    if episode is not None:
        assert metadata == episode.metadata
        assert recovered.faults == ()
        assert recovered.samples == recovered.samples_expected == len(episode.time)
        check_valid(episode)
    elif "holds no whole episode" not in refused:
        assert unvouched == refused
    if recovered is not None:
        check_valid(recovered.episode)
        assert len(recovered.summary.splitlines()) == 1
        assert recovered.samples == len(recovered.episode.time)
        if episode is None:
            assert recovered.faults
            assert recovered.episode.metadata["recovered"]["samples"] == recovered.samples
        if original is not None:
            check_same_samples(recovered.episode, original)
    assert "MemoryError" not in refused + unvouched + lost
    return "whole" if episode is not None else "recovered" if recovered is not None else "refused"


def peak_memory() -> int:
    """Largest memory of this process [bytes]; `ru_maxrss` would count that of the one that started it too."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return 1024 * next(int(line.split()[1]) for line in status.open() if line.startswith("VmHWM"))


def child(kind: str, first: int, count: int, path: str) -> None:
    """Read mutated files or bombs in this process; print figures, or the name of the one that went wrong."""
    ended: Counter[str] = Counter()
    slowest, file = (0.0, ""), Path(path)
    signal.signal(signal.SIGPROF, alarm)
    for index in range(first, first + count):
        if kind == "mutations":
            data, base, honest = mutated.mutated(index)
            name, original = f"seed {index}", base.episode if honest else None
        else:
            name, make = list(BOMBS.items())[index]
            data, original = make(), None
        file.write_bytes(data)
        SPENT.clear()
        try:
            ended[check_file(file, original)] += 1
        except BaseException as error:
            raise RuntimeError(f"{kind}, {name}: {type(error).__name__}: {error}") from error
        slowest = max(slowest, (max(SPENT), name))
    print(json.dumps({"ended": ended, "slowest": slowest, "peak": peak_memory()}))


def run_child(kind: str, first: int, count: int, path: Path) -> dict[str, Any]:
    """The same in a process of its own, whose memory is its own; fails with what it says."""
    code = f"import test_mutations; test_mutations.child({kind!r}, {first}, {count}, {str(path)!r})"
    here = Path(__file__).parent
    folders = [here, here.parent / "support", REPOSITORY]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))}
    command = [sys.executable, "-c", code]
    ran = subprocess.run(
        command, capture_output=True, text=True, env=environment, timeout=60 + LONGEST * count
    )
    assert ran.returncode == 0, ran.stderr.splitlines()[-1]
    print(f"{kind}: {ran.stdout}", end="")
    return json.loads(ran.stdout)


@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.endurance)])
def test_mutated_files_end_in_data_or_in_one_line(tmp_path, count):
    figures = run_child("mutations", 0, count, tmp_path / "a.mcap")
    assert sum(figures["ended"].values()) == count
    assert figures["slowest"][0] < LONGEST
    assert figures["peak"] < MOST_MEMORY / 4  # small files: nothing of theirs may pile up
    # The mutations are worth something only if every end is reached.
    assert min(figures["ended"].get(end, 0) for end in ("whole", "recovered", "refused")) > count / 50


def file_with(*parts: bytes) -> bytes:
    """A file of these records and no CRC beyond theirs, with what makes an episode around them."""
    data = mutated.bases()[0].data
    first = next(part for part in mutated.records(data) if part[0] == 12)  # the metadata
    described = [part for part in mutated.records(data) if part[0] in (mutated.SCHEMA, mutated.CHANNEL)]
    end = mutated.record(mutated.DATA_END, bytes(4)) + mutated.record(mutated.FOOTER, bytes(20))
    return b"".join([mutated.MAGIC, first, *dict.fromkeys(described), *parts, end, mutated.MAGIC])


def padding(size: int = 2_000_000) -> bytes:
    """An attachment that makes a file as large as one of a minute, on which depends what it may unpack to."""
    head = bytes(16) + 2 * bytes(4) + struct.pack("<Q", size)
    return mutated.record(9, head + bytes(size) + bytes(4))


def metadata(name: str, text: str) -> bytes:
    item = struct.pack("<I", len(name)) + name.encode() + struct.pack("<I", len(text)) + text.encode()
    return mutated.record(12, b"\x08\0\0\0endotwin" + struct.pack("<I", len(item)) + item)


def samples(payloads: list[bytes], count: int) -> bytes:
    """Messages on the first channels, at 1 ns each."""
    return b"".join(
        mutated.message(k + 1, time, data) for time in range(count) for k, data in enumerate(payloads)
    )


def truth(count: int) -> bytes:
    values = [0.0] * count
    return schema.Truth(wire_tension_a_n=values, wire_tension_b_n=values).SerializeToString()


def frame(content: bytes, size: int | None) -> bytes:
    """A chunk whose zstd frame does not tell its size; the record claims `size`."""
    packed = zstandard.ZstdCompressor(write_content_size=False).compress(content)
    body = bytes(16) + struct.pack("<QII", size, 0, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    return mutated.record(mutated.CHUNK, body)


NOTHING = bytes(2**26)
"""What unpacks from 2 kB."""

BOMBS: dict[str, Callable[[], bytes]] = {
    "chunks that unpack to 64 MiB each": lambda: file_with(padding(), *[mutated.chunk(NOTHING)] * 200),
    "a chunk that claims 2 GiB": lambda: file_with(mutated.chunk(b"", claimed=2**31)),
    "a chunk that claims 2^63 bytes": lambda: file_with(mutated.chunk(b"", claimed=2**63)),
    "a frame that does not tell its size": lambda: file_with(frame(NOTHING, 2**16), frame(NOTHING, 2**30)),
    "a record of 2^60 bytes": lambda: file_with(b"\x06" + struct.pack("<Q", 2**60) + bytes(100)),
    "a list of 2^31 doubles": lambda: file_with(
        mutated.chunk(samples([b"", b"\x12" + b"\x80\x80\x80\x80\x40" + bytes(64), b""], 3))
    ),
    "messages without end": lambda: file_with(
        padding(), mutated.chunk(mutated.message(1, 0, b"") * 2_000_000)
    ),
    "as many messages as allowed": lambda: file_with(
        padding(), mutated.chunk(samples([b"", b"", b""], 83_000))
    ),
    "as many doubles as allowed": lambda: file_with(
        padding(), mutated.chunk(samples([b"", truth(500_000), b""], 14))
    ),
    "joints without end": lambda: file_with(
        padding(), mutated.chunk(samples([b"", b"", b"", b"", b"\x12\x00" * 2_000_000], 14))
    ),
    "as many joints as allowed": lambda: file_with(
        padding(), mutated.chunk(samples([b"", b"", b"", b"", b"\x12\x00" * 100_000], 19))
    ),
    "lists of lists": lambda: file_with(metadata("a", "[" + "[]," * 600_000 + "1]")),
    "lists in lists": lambda: file_with(metadata("a", "[" * 2_000_000)),
    "chunks that are none": lambda: file_with(*[mutated.chunk(b"")[:50]] * 40_000, padding(1000)),
    "a tail of zeros": lambda: mutated.bases()[0].data[:-20] + bytes(2**25),
    "records of nothing": lambda: file_with(mutated.record(200, b"") * 200_000),
}


@pytest.mark.parametrize("count", [4, pytest.param(len(BOMBS), marks=pytest.mark.slow)])
def test_small_files_cannot_fill_the_memory_or_the_time(tmp_path, count):
    figures = run_child("bombs", 0, count, tmp_path / "a.mcap")
    assert figures["slowest"][0] < LONGEST
    assert figures["peak"] < MOST_MEMORY
