"""A record of random numbers, what is said of two that should be equal, and what others read of one."""

import dataclasses
import io
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from twin.episode import OPTIONAL, Episode

LINK = 0.01  # [m] section_length / vertebrae of the preset below


def make_episode(
    samples: int = 12,
    vertebrae: int = 3,
    elements: int | None = 2,
    seed: int = 0,
    start: float = 0.0,
    *,
    planes: int = 1,
    drive: bool = False,
    drawn: bool = False,
) -> Episode:
    """Random numbers that use every digit of a double.

    `elements=None`: no load cells, as when measured; `planes=2`: it bends sideways too; `drive`: what the
    pulley, the sheath and slack wires did is known; `drawn`: the preset tells what the endoscope looks like.
    """
    rng = np.random.default_rng(seed)
    lengths, elements = (0, 0) if elements is None else (elements + 1, elements)
    episode = Episode(
        time=start + np.arange(samples) * 0.02,
        pull=rng.normal(scale=1e-3, size=samples),
        bend=rng.normal(size=samples),
        measured_bend=rng.normal(size=samples),
        joint_angle=rng.normal(size=(samples, vertebrae)),
        wire_tension=rng.normal(size=(samples, 2 * planes, lengths)),
        sheath_friction=rng.normal(size=(samples, 2 * planes, elements)),
        metadata={
            "seed": seed,
            "preset": {"name": "Öse", "vertebrae": vertebrae, "section_length": LINK * vertebrae},
            "versions": {"mujoco": "3.17", "strokes_mm": [2.0, 4.25]},
        },
        attachments={"endoscope.xml": b"<mujoco/>", "empty.bin": b"", "preset.yaml": bytes(range(256))},
    )
    recorded = ["pulley", "sheath_bend"] * drive + ["lateral_pull", "lateral_bend"] * (planes == 2)
    optional = {field: rng.normal(scale=1e-2, size=samples) for field in recorded}
    if drive and lengths > 0:
        slack = rng.normal(scale=1e-4, size=episode.wire_tension.shape)
        optional["wire_slack"] = np.maximum(slack, 0)
    if drawn:
        episode.metadata["preset"].update(wire_offset=1e-3, bending_planes=planes)
    if planes == 2 and vertebrae > 0:
        optional["lateral_joint_angle"] = rng.normal(size=(samples, vertebrae))
    return dataclasses.replace(episode, **optional)


def assert_equal(read: Episode, written: Episode) -> None:
    exact = ("joint_angle", "wire_tension", "sheath_friction", "lateral_joint_angle")
    through_degrees_or_millimetres = {"time", "pull", "bend", "measured_bend", *OPTIONAL} - {*exact}
    for field in through_degrees_or_millimetres:
        np.testing.assert_allclose(
            getattr(read, field), getattr(written, field), rtol=1e-12, atol=0, strict=True
        )
    for field in exact:
        np.testing.assert_array_equal(getattr(read, field), getattr(written, field), strict=True)
    assert read.metadata == written.metadata
    assert read.attachments == written.attachments


def messages(path: Path) -> dict[str, list]:
    """Every message by topic as (record, decoded), by the public reader and the schemas inside the file."""
    result: dict[str, list] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            result.setdefault(channel.topic, []).append((message, decoded))
    return result


def records_of(content: bytes) -> list[Any]:
    """All records of a file with chunks unopened, every CRC of the data section checked."""
    reader = StreamReader(io.BytesIO(content), emit_chunks=True, validate_crcs=True)
    return list(reader.records)


def of_kind(records: list[Any], kind: type) -> list[Any]:
    return [record for record in records if isinstance(record, kind)]


def in_file_order(content: bytes) -> list[tuple[Channel, Message]]:
    """Every message as a reader finds it that takes one record after the other, all CRCs checked."""
    channels, found = {}, []
    for record in StreamReader(io.BytesIO(content), validate_crcs=True).records:
        if isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            found.append((channels[record.channel_id], record))
    return found
