"""Extreme numbers in files and options: what a format can hold, and no quantity has. Checksums stay valid."""

import contextlib
import io
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer

from twin.recording.messages import SCHEMAS

Generator = np.random.Generator
Number = float | int
EXTREME: tuple[Number, ...] = (
    *(1e300, -1e300, 1e39, -1e39, 1e-320, -0.0, float("nan"), float("inf"), -float("inf")),
    *(10**18, -(10**18), 10**400),
)
FIELDS = (
    *("/command pull_mm", "/command log_time", "/measurement measured_deg", "/joint_states joints"),
    *("/truth truth_deg", "/truth pulley_mm", "/truth wire_tension_a_n", "/truth wire_tension_b_n"),
    *("/truth sheath_friction_a_n", "/truth wire_slack_b_mm"),
)
"""Numbers that an episode is read from: a topic, and a field of its messages or the time."""
LOG_TIMES = (0, 2**63, 2**64 - 1)
SAMPLES = 20  # one of the first so many is changed


def pick(rng: Generator, values: Any) -> Any:
    return values[rng.integers(len(values))]


def numbers_in(value: Any, at: tuple = ()) -> list[tuple]:
    """Keys that lead to each number inside."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    found = [place for key, inside in items for place in numbers_in(inside, (*at, key))]
    return found or ([at] if isinstance(value, int | float) and not isinstance(value, bool) else [])


def in_tree(load: Callable, dump: Callable, rng: Generator, data: bytes) -> tuple[bytes, str]:
    """Replace one number of a JSON or YAML file."""
    content = load(data)
    *way, key = pick(rng, numbers_in(content))
    inside, value = content, pick(rng, EXTREME)
    for step in way:
        inside = inside[step]
    inside[key] = value
    return dump(content).encode(), f"{[*way, key]} = {value!r:.9}"


def in_table(rng: Generator, data: bytes) -> tuple[bytes, str]:
    """Replace one field of a CSV file."""
    head, *rows = [line.split(",") for line in data.decode().splitlines()]
    row, column, value = int(rng.integers(len(rows))), int(rng.integers(len(head))), pick(rng, EXTREME)
    rows[row][column] = str(value)
    return "\n".join(map(",".join, [head, *rows])).encode() + b"\n", f"{head[column]} = {value!r:.9}"


def in_recording(rng: Generator, data: bytes) -> tuple[bytes, str]:
    """Replace one number of a message or of the metadata of an MCAP file, and write the file again."""
    reader, file = make_reader(io.BytesIO(data)), io.BytesIO()
    writer, value, place = Writer(file), pick(rng, EXTREME), pick(rng, (*FIELDS, *["metadata"] * 3))
    topic, _, field = place.partition(" ")
    writer.start()
    for record in reader.iter_metadata():
        items = dict(record.metadata)
        if place == "metadata":
            changed, what = in_tree(json.loads, json.dumps, rng, in_json(items))
            items = {name: json.dumps(item) for name, item in json.loads(changed).items()}
            place = f"metadata {what}"
        writer.add_metadata(record.name, items)
    for attached in reader.iter_attachments():
        writer.add_attachment(0, 0, attached.name, attached.media_type, attached.data)
    channels: dict[str, int] = {}
    left = int(rng.integers(SAMPLES))
    for kind, channel, message in reader.iter_messages():
        if channel.topic not in channels:
            schema = writer.register_schema(kind.name, kind.encoding, kind.data)
            channels[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema)
        payload, time = message.data, message.log_time
        if channel.topic == topic:
            if left == 0 and field == "log_time":
                time = pick(rng, LOG_TIMES)
            elif left == 0:
                payload = with_number(SCHEMAS[topic].FromString(payload), field, value)
            left -= 1
        writer.add_message(channels[channel.topic], time, payload, message.publish_time)
    writer.finish()
    return file.getvalue(), place if place.startswith("metadata") else f"{place} = {value!r:.9}"


def in_json(items: dict[str, str]) -> bytes:
    return ("{" + ",".join(f"{json.dumps(name)}:{text}" for name, text in items.items()) + "}").encode()


def with_number(message: Any, field: str, value: Number) -> bytes:
    number = float("inf")
    with contextlib.suppress(OverflowError):
        number = float(value)
    if field == "joints":
        message.joints[0].position = number
    elif isinstance(getattr(message, field), float):
        setattr(message, field, number)
    elif len(getattr(message, field)):
        getattr(message, field)[0] = number
    return bytes(message.SerializeToString())


EDITS: dict[str, Callable[[Generator, bytes], tuple[bytes, str]]] = {
    ".json": partial(in_tree, json.loads, json.dumps),
    ".yaml": partial(in_tree, yaml.safe_load, partial(yaml.safe_dump, sort_keys=False)),
    ".csv": in_table,
    ".mcap": in_recording,
}
"""Edit of each format: the bytes of a good file to those of one with an extreme number, and its place."""


def put_number(path: Path, seed: int) -> str:
    """Put an extreme number into a good file; returns its place and value."""
    changed, what = EDITS[path.suffix](np.random.default_rng(seed), path.read_bytes())
    path.write_bytes(changed)
    return f"{path.name}: {what}"
