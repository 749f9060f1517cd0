"""The MCAP library of TypeScript reads from an episode, bit for bit, what was written in Python."""

import base64
import dataclasses
import hashlib
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import make_episode, messages
from repository import REPOSITORY

from twin.episode import Episode
from twin.physics import simulate
from twin.preset.file import load_preset
from twin.recording import write_episode

SOURCE = REPOSITORY / "tests" / "support" / "independent_reader"
FILES = ("package.json", "package-lock.json", "read_mcap.mjs")
OLDEST_NODE = 20
UNREACHABLE = re.compile(
    r"ENOTFOUND|EAI_AGAIN|ECONNREFUSED|ECONNRESET|ETIMEDOUT|ENETUNREACH|EHOSTUNREACH|ENOTCACHED"
    r"|ERR_SOCKET_TIMEOUT|FETCH_ERROR|E401|E403|E407|E50[0-9]"
)


def missing_measurements() -> Episode:
    episode = make_episode(samples=40, seed=2, drive=True)
    measured = episode.measured_bend.copy()
    measured[[0, 7, 8, 39]] = np.nan
    return dataclasses.replace(episode, measured_bend=measured)


def simulated() -> Episode:
    preset = load_preset("ureteroscope").replace(bending_planes=2, vertebrae=4)
    way = np.sin(np.linspace(0, 2 * np.pi, 200))
    return simulate(preset, 4e-3 * way, 2 * preset.control_period, lateral_pull=2e-3 * way**2)


EPISODES = {
    "one plane": lambda: make_episode(drive=True, drawn=True),
    "two planes": lambda: make_episode(samples=30, seed=1, planes=2, drive=True),
    "missing measurements": missing_measurements,
    "as measured": lambda: make_episode(vertebrae=0, elements=None, seed=3),
    "late start": lambda: make_episode(samples=5, start=9e9 / 7),
    "simulated": simulated,
}


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The installed reader, outside the tree; skips only where Node or its registry is out of reach."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed: no independent reader of MCAP can run")
    version = subprocess.run(["node", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    if int(version.removeprefix("v").split(".")[0]) < OLDEST_NODE:
        pytest.skip(f"node {version} is older than {OLDEST_NODE}: the independent reader cannot run")
    folder = tmp_path_factory.mktemp("independent_reader")
    for name in FILES:
        shutil.copy(SOURCE / name, folder)
    install = ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--prefer-offline"]
    waits = ["--fetch-timeout=15000", "--fetch-retries=1", "--fetch-retry-mintimeout=1000"]
    done = subprocess.run([*install, *waits], cwd=folder, capture_output=True, text=True, timeout=300)
    if done.returncode != 0:
        unreachable = [line for line in done.stderr.splitlines() if UNREACHABLE.search(line)]
        if unreachable:
            pytest.skip(f"npm could not fetch the packages of the independent reader: {unreachable[0]}")
        pytest.fail(f"npm ci failed: {done.stderr}")
    return folder / "read_mcap.mjs"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Episode, Path]]:
    folder = tmp_path_factory.mktemp("episodes")
    episodes = {name: make() for name, make in EPISODES.items()}
    return {
        name: (episode, write_episode(folder / f"{name}.mcap", episode)) for name, episode in episodes.items()
    }


@pytest.fixture(scope="module")
def read(reader: Path, written: dict[str, tuple[Episode, Path]]) -> dict[str, dict]:
    """What the independent reader says of each episode."""
    done = run(reader, "--values", *(path for _, path in written.values()))
    assert done.returncode == 0, done.stderr
    return dict(zip(written, json.loads(done.stdout), strict=True))


def run(reader: Path, *arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    command = ["node", str(reader), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def numbers(text: str, kind: str = "<f8") -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def assert_same_bits(values: Any, wanted: Any) -> None:
    """Equal as 8 bytes: 0.0 is not -0.0, and NaN is NaN."""
    one, other = (np.ascontiguousarray(item, dtype="<f8").view("<u8") for item in (values, wanted))
    np.testing.assert_array_equal(one, other, strict=True)


def flat(message: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield path and value of every field that a decoded message has, as Python's Protobuf sees it."""
    for field in message.DESCRIPTOR.fields:
        value, path = getattr(message, field.name), prefix + field.name
        if field.is_repeated:
            items = [(f"{path}[{index}]", item) for index, item in enumerate(value)]
        elif not field.has_presence or message.HasField(field.name):
            items = [(path, value)]
        else:
            items = []
        for place, item in items:
            if field.message_type is not None:
                yield from flat(item, f"{place}.")
            else:
                yield place, hashlib.sha256(item).hexdigest() if isinstance(item, bytes) else item


every_episode = pytest.mark.parametrize("name", EPISODES)


@every_episode
def test_independent_reader_finds_every_message_at_its_time(read, written, name):
    episode, path = written[name]
    topics, mine = read[name]["topics"], messages(path)
    assert set(topics) == set(mine)
    assert int(read[name]["message_count"]) == sum(len(records) for records in mine.values())
    for topic, records in mine.items():
        times = [message.log_time for message, _ in records]
        of_topic = topics[topic]
        assert of_topic["count"] == len(times)
        assert (int(of_topic["first_log_time"]), int(of_topic["last_log_time"])) == (times[0], times[-1])
        assert int(of_topic["sum_of_log_times"]) == sum(times)
        assert numbers(of_topic["log_times"], "<u8").tolist() == times
        assert of_topic["publish_times"] == of_topic["log_times"]
        payloads = b"".join(message.data for message, _ in records)
        assert of_topic["payload_sha256"] == hashlib.sha256(payloads).hexdigest()
    samples = [round(second * 1e9) for second in episode.time.tolist()]
    assert numbers(topics["/command"]["log_times"], "<u8").tolist() == samples
    seen = [time for time, bend in zip(samples, episode.measured_bend, strict=True) if not np.isnan(bend)]
    assert numbers(topics["/measurement"]["log_times"], "<u8").tolist() == seen


@every_episode
def test_independent_reader_decodes_every_value_by_the_schema_in_the_file(read, written, name):
    """All fields of all messages, of topics that this test does not know too."""
    for topic, records in messages(written[name][1]).items():
        of_topic = read[name]["topics"][topic]
        assert of_topic["schema"] == records[0][1].DESCRIPTOR.full_name
        assert of_topic["encoding"] == "protobuf, protobuf"
        wanted: dict[str, list] = {}
        for _, message in records:
            for path, value in flat(message):
                wanted.setdefault(path, []).append(value)
        assert set(of_topic["fields"]) == set(wanted)
        for path, values in wanted.items():
            field = of_topic["fields"][path]
            assert field["count"] == len(values)
            if isinstance(values[0], str):
                assert field["texts"] == values
            else:
                assert_same_bits(numbers(field["values"]), values)
                assert (field["min"], field["max"]) == (min(values), max(values))


@every_episode
def test_independent_reader_reads_the_numbers_of_the_episode(read, written, name):
    """Past Python's MCAP and Protobuf altogether: from the arrays that were written."""
    episode, topics = written[name][0], read[name]["topics"]
    measured = episode.measured_deg
    wanted = {
        "/command.pull_mm": episode.pull_mm,
        "/truth.truth_deg": episode.truth_deg,
        "/measurement.measured_deg": measured[~np.isnan(measured)],
    }
    for index, wire in enumerate("abcd"[: episode.wire_tension.shape[1]]):
        for length in range(episode.wire_tension.shape[2]):
            wanted[f"/truth.wire_tension_{wire}_n[{length}]"] = episode.wire_tension[:, index, length]
        for element in range(episode.sheath_friction.shape[2]):
            wanted[f"/truth.sheath_friction_{wire}_n[{element}]"] = episode.sheath_friction[:, index, element]
    vertebrae = episode.joint_angle.shape[1]
    hinges = episode.joint_angle
    if episode.lateral_joint_angle.size > 0:
        hinges = np.hstack([hinges, episode.lateral_joint_angle])
    for index in range(hinges.shape[1]):
        wanted[f"/joint_states.joints[{index}].position"] = hinges[:, index]
    for path, values in wanted.items():
        topic, _, field = path.partition(".")
        assert_same_bits(numbers(topics[topic]["fields"][field]["values"]), values)
    assert ("/joint_states" in topics) == ("/tf" in topics) == (vertebrae > 0)


@every_episode
def test_independent_reader_finds_metadata_and_attachments(read, written, name):
    episode = written[name][0]
    (record,) = read[name]["metadata"]
    assert record["name"] == "endotwin"
    assert {key: json.loads(text) for key, text in record["entries"].items()} == episode.metadata
    found = {item["name"]: (item["size"], item["sha256"]) for item in read[name]["attachments"]}
    assert found == {
        key: (len(data), hashlib.sha256(data).hexdigest()) for key, data in episode.attachments.items()
    }


@pytest.mark.parametrize("place", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_independent_reader_refuses_a_file_with_one_flipped_bit(reader, written, tmp_path, place):
    """So its agreement means something: it checks."""
    data = bytearray(written["simulated"][1].read_bytes())
    data[int(place * len(data))] ^= 0x10
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    done = run(reader, damaged)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"{damaged}: ")


def test_packages_are_pinned_and_come_from_the_public_registry():
    manifest, lock = (json.loads((SOURCE / name).read_text()) for name in FILES[:2])
    assert manifest["dependencies"]["@mcap/core"] == "2.2.2"
    assert all(re.fullmatch(r"\d+\.\d+\.\d+", version) for version in manifest["dependencies"].values())
    packages = {name: package for name, package in lock["packages"].items() if name}
    assert {f"node_modules/{name}" for name in manifest["dependencies"]} <= set(packages)
    for package in packages.values():
        assert package["resolved"].startswith("https://registry.npmjs.org/")
        assert package["integrity"].startswith("sha512-")
