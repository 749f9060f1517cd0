"""A file in small chunks, which of its samples precede a fault, and what should be recovered."""

import dataclasses
import io
from pathlib import Path

import mutated
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mutated import MAGIC
from recorded import assert_equal, make_episode

from twin.episode import Episode
from twin.recording import Recovered, recover_episode

STEP = 20_000_000  # [ns] between samples of `make_episode`

EPISODE = make_episode(60)
SPLIT = mutated.rewritten(EPISODE, chunk_size=4000)
"""Chunks that begin and end in the middle of a sample."""


def recover(path: Path, data: bytes) -> Recovered:
    path.write_bytes(data)
    return recover_episode(path)


def offsets(data: bytes, opcode: int) -> list[int]:
    """Where the records of a kind begin in a whole file."""
    found, at = [], len(MAGIC)
    for part in mutated.records(data):
        if part[0] == opcode:
            found.append(at)
        at += len(part)
    return found


def messages_of_chunks(data: bytes) -> list[set[tuple[str, int]]]:
    """Topic and sample of the messages in each chunk, as the mcap library reads them."""
    topics, chunks = {}, []
    for part in StreamReader(io.BytesIO(data), emit_chunks=True).records:
        inner = breakup_chunk(part) if isinstance(part, Chunk) else [part]
        topics |= {entry.id: entry.topic for entry in inner if isinstance(entry, Channel)}
        if isinstance(part, Chunk):
            inside = [entry for entry in inner if isinstance(entry, Message)]
            chunks.append({(topics[entry.channel_id], round(entry.log_time / STEP)) for entry in inside})
    return chunks


def samples_before(end: int) -> list[int]:
    """Samples of `SPLIT` of which every message is in a chunk that ends before a byte of the file."""
    chunks, starts = messages_of_chunks(SPLIT), offsets(SPLIT, mutated.CHUNK)
    parts = [part for part in mutated.records(SPLIT) if part[0] == mutated.CHUNK]
    lost = {index for index, part in enumerate(parts) if starts[index] + len(part) > end}
    gone = {sample for index in lost for _, sample in chunks[index]}
    return sorted({sample for chunk in chunks for _, sample in chunk} - gone)


def part_of(episode: Episode, samples: list[int]) -> Episode:
    arrays = {
        field.name: getattr(episode, field.name)
        for field in dataclasses.fields(episode)
        if field.name not in ("metadata", "attachments")
    }
    taken = {name: values[samples] if len(values) else values for name, values in arrays.items()}
    return dataclasses.replace(episode, **taken)


def check(found: Recovered, samples: list[int], expected: int | None, episode: Episode = EPISODE) -> None:
    mark = {"recovered": {"samples": len(samples), "expected": expected}}
    original = part_of(episode, samples)
    assert_equal(found.episode, dataclasses.replace(original, metadata=original.metadata | mark))
    assert found.samples == len(samples)
    assert found.samples_expected == expected
    assert found.faults
