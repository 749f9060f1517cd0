"""Reader of episodes from MCAP files; a damaged file gives one line that names the file and the fault."""

import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError, MissingFileError
from twin.recording.contents import JOINTS_TOPIC, TOPICS, Contents
from twin.recording.endotwin_pb2 import Estimate
from twin.recording.mcap_file.records import MAGIC, FileRecord, mcap_bytes, parse, record_at, summary_fault
from twin.recording.messages import places_of

Array = NDArray[np.float64]

COMMAND_TOPIC = "/command"
"""Topic whose messages are the samples of an episode."""

HINT = "; `recover_episode` saves what is whole"
"""Hint after the fault of a file that is cut off or damaged."""

_DATA = (Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA)


def read_episode(path: str | Path, *, hidden: bool = True) -> Episode:
    """Read one episode; `messages.decode` says which arrays are empty where nothing was recorded.

    Args:
        path: an MCAP file as `write_episode` makes it. Topics beyond those of an episode are skipped.
        hidden: False leaves out the hinge angles and the wires, which take most of the time.

    Returns:
        The episode. In its metadata, tuples have become lists, as JSON has no tuples.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an MCAP file, is cut off or damaged, or holds no whole episode.
    """
    path = Path(path)
    contents = _read(path, TOPICS if hidden else TOPICS - {JOINTS_TOPIC})
    try:
        return whole_episode(contents, hidden=hidden)
    except ValueError as error:
        raise InputError(f"{path} {error}") from error


def read_metadata(path: str | Path) -> dict[str, Any]:
    """Read the metadata of an episode, and verify every CRC, length and count of its file.

    The messages are not decoded, which is what `read_episode` spends most of its time on.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an MCAP file, is cut off or damaged, or holds no metadata of an episode.
    """
    path = Path(path)
    contents = _read(path, kept=())
    try:
        contents.check_topics()
        return contents.metadata()
    except Exception as error:
        raise InputError(f"{path} holds no whole episode: {one_line(error)}") from error


def read_estimates(path: str | Path, topic: str) -> Array:
    """Read the angles of a topic of `Estimate` messages beside an episode: an estimator's, or `/reference`.

    Args:
        path: as of `read_episode`.
        topic: the topic.

    Returns:
        (N,) angle at each sample of the episode [deg], NaN where there is no message; (0,) if the file has
        no such topic.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an MCAP file, is cut off or damaged, or the messages of the topic are of another
            schema, infinite, or not at the times of the samples.
    """
    path = Path(path)
    contents = _read(path, {COMMAND_TOPIC, topic})
    if topic not in contents.topics.values():
        return np.empty(0)
    try:
        contents.check_schema(topic, Estimate)
        commands = contents.times.get(COMMAND_TOPIC, [])
        angle_deg = np.full(len(commands), np.nan)
        messages = [Estimate.FromString(payload) for payload in contents.payloads.get(topic, [])]
        places = places_of(contents.times.get(topic, []), commands, topic)
        angle_deg[places] = [message.estimate_deg for message in messages]
        if np.isinf(angle_deg).any():
            raise InputError(f"an angle of {topic} is infinite")
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path} holds no whole {topic}: {one_line(error)}") from error
    return angle_deg


def read_dataset(path: str | Path, *, hidden: bool = True) -> list[Episode]:
    """Read all episodes of a folder, in the order of the file names, or the one of a file.

    Args:
        path: the folder or file.
        hidden: False leaves out the hidden state, as in `read_episode`.

    Raises:
        FileNotFoundError: there is no such folder or file, or no `*.mcap` in the folder.
        ValueError: a file is damaged (see `read_episode`).
    """
    return [read_episode(file, hidden=hidden) for file in episode_files(path)]


def episode_files(path: str | Path) -> list[Path]:
    """Return the `*.mcap` files of a folder in the order of their names, or the single file of a path.

    Raises:
        FileNotFoundError: there is no `*.mcap` in the folder.
    """
    path = Path(path)
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"))
    if not files:
        raise MissingFileError(f"no *.mcap file in {path}")
    return files


def whole_contents(data: bytes, kept: Collection[str] = TOPICS) -> Contents:
    """Return the contents of a file, which must be complete and undamaged.

    Args:
        data: a file that begins with the MCAP mark.
        kept: topics whose messages are wanted.

    Raises:
        ValueError: the file is cut off or damaged; the text goes on after the name of the file.
    """
    if len(data) < 2 * len(MAGIC) or not data.endswith(MAGIC):
        raise InputError("is cut off: it does not end with the MCAP mark")
    contents = Contents(len(data), kept)
    # Damaged bytes raise exceptions of no closed list: mcap, zstandard and Protobuf have their own and let
    # through those of struct, of codecs and of dictionaries.
    try:
        # No chunk is unpacked before the CRC of the data section is known to match, which comes last.
        for record in list(_records(data)):
            contents.add(data, record)
            if record.opcode == Opcode.STATISTICS:
                _check_counts(contents, parse(data, record))
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"is damaged: {one_line(error)}") from error
    return contents


def whole_episode(contents: Contents, *, hidden: bool = True) -> Episode:
    """Return the episode of the contents of a file, with its hidden state or without.

    Raises:
        ValueError: they make none; the text goes on after the name of the file.
    """
    try:
        return contents.episode(contents.metadata(), hidden=hidden)
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"holds no whole episode: {one_line(error)}") from error


def one_line(error: Exception) -> str:
    """Return the text of an error in one line, with its class where the text alone says too little."""
    text = " ".join(str(error).split())
    if isinstance(error, ValueError) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _read(path: Path, kept: Collection[str]) -> Contents:
    data = mcap_bytes(path)
    try:
        return whole_contents(data, kept)
    except ValueError as error:
        raise InputError(f"{path} {error}{HINT}") from error


def _records(data: bytes) -> Iterator[FileRecord]:
    """Yield the records of a file up to its footer; the CRCs of data section and summary are checked."""
    offset, end = len(MAGIC), len(data) - len(MAGIC)
    data_ended = False
    while offset < end:
        record = record_at(data, offset, end)
        if record.opcode == Opcode.DATA_END:
            expected = parse(data, record).data_section_crc
            if expected not in (0, zlib.crc32(memoryview(data)[:offset])):
                raise InputError("the CRC of the data section does not match")
            data_ended = True
        elif record.opcode in _DATA and data_ended:
            raise InputError(f"the record at byte {offset} comes after the end of the data section")
        elif record.opcode == Opcode.FOOTER:
            fault = summary_fault(data, record)
            if fault is not None:
                raise InputError(fault)
            if not data_ended:
                raise InputError("the data section has no end")
            if record.end != end:
                raise InputError(f"{end - record.end} bytes come after the footer")
            return
        yield record
        offset = record.end
    raise InputError("it has no footer")


def _check_counts(contents: Contents, statistics: Any) -> None:
    """Check the number of records against the statistics of the file."""
    for kind, found in contents.counts.items():
        claimed = getattr(statistics, f"{kind}_count")
        if claimed != found:
            raise InputError(f"the summary counts {claimed} records of kind {kind}, the file has {found}")
