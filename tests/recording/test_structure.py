"""A file is believed only if its records belong together, even where it has no CRC."""

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.data_stream import RecordBuilder
from mcap.records import Channel
from mutated import CHUNK, DATA_END, MAGIC, chunk, record, records, without_crcs
from recorded import make_episode

from twin.recording import read_episode, read_metadata, write_episode

METADATA = 12


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_episode(tmp_path_factory.mktemp("whole") / "a.mcap", make_episode()).read_bytes()


def described(channel: int, topic: str) -> bytes:
    builder = RecordBuilder()
    Channel(channel, topic, "protobuf", {}, 0).write(builder)
    return builder.end()


@pytest.mark.parametrize(
    ("edit", "fault"),
    [
        (lambda parts: [part for part in parts if part[0] != DATA_END], "the data section has no end"),
        (lambda parts: parts[:-1], "it has no footer"),
        (lambda parts: [*parts, parts[-1]], "29 bytes come after the footer"),
        (lambda parts: [*parts[:-1], parts[1], parts[-1]], "comes after the end of the data section"),
        (
            lambda parts: [part for part in parts if part[0] != METADATA],
            "counts 1 records of kind metadata, the file",
        ),
        (
            lambda parts: [part for part in parts if part[0] != CHUNK],
            "counts 72 records of kind message, the",
        ),
        (lambda parts: [parts[0], chunk(b""), *parts[1:]], "counts 1 records of kind chunk, the file has 2"),
        (lambda parts: [parts[0], chunk(bytes(8)), *parts[1:]], "the last record of a chunk is cut off"),
        (lambda parts: [parts[0], chunk(record(200, b"12")[:-1]), *parts[1:]], "claims 2 bytes: 1 are left"),
        (
            lambda parts: [parts[0], chunk(record(5, b"12")), *parts[1:]],
            "a message has 2 bytes: must have 22",
        ),
        (lambda parts: [parts[0], chunk(b"", claimed=3), *parts[1:]], "unpacks to 0 bytes, not to the 3"),
        (lambda parts: [*parts[:-1], described(1, "/other"), parts[-1]], "channel 1 is described twice"),
        (lambda parts: [parts[0], described(99, "/other")[:-1] + b"\1", *parts[1:]], "a field of 4 bytes"),
    ],
)
def test_records_that_do_not_belong_together_are_named(tmp_path, whole, edit, fault):
    path = tmp_path / "a.mcap"
    path.write_bytes(without_crcs(MAGIC + b"".join(edit(records(whole[: -len(MAGIC)]))) + MAGIC))
    for function in (read_episode, read_metadata):
        with pytest.raises(ValueError, match=fault) as caught:
            function(path)
        assert str(caught.value).startswith(f"{path} is damaged: ")


def test_metadata_is_read_without_the_messages_but_not_from_a_damaged_file(tmp_path, whole):
    path = tmp_path / "a.mcap"
    path.write_bytes(whole)
    assert read_metadata(path) == make_episode().metadata
    for place in range(0, len(whole), 97):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        said = [text_of(function, path) for function in (read_metadata, read_episode)]
        assert said[0] == said[1]


def text_of(function: Callable, path: Path) -> str:
    """What is said of a damaged file; of another, nothing, and its metadata is as it was."""
    try:
        result = function(path)
    except ValueError as error:
        return str(error)
    assert getattr(result, "metadata", result) == make_episode().metadata
    return ""


def test_topics_are_checked_with_the_metadata(tmp_path, whole):
    path = tmp_path / "a.mcap"
    path.write_bytes(without_crcs(whole.replace(b"/truth", b"/trust")))
    with pytest.raises(ValueError, match="holds no whole episode: topic /truth is missing"):
        read_metadata(path)
