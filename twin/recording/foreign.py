"""MCAP files of other software: their messages, decoded where they are JSON or Protobuf.

Messages of ROS are left as bytes, with the definition of their type.
"""

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, NamedTuple

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from twin.errors import InputError
from twin.files.json_text import parse_json
from twin.recording.reader import LARGEST_FIELD, named_errors, whole_contents


class Topic(NamedTuple):
    """Messages of a topic."""

    times: list[int]  # at which they were recorded [ns]
    messages: list[Any]  # decoded, or bytes of ROS
    kind: str  # of ROS messages: `ros1` or `cdr`; else empty
    type_name: str
    definition: str  # of the type of ROS messages


def read_topics(path: Path, wanted: Collection[str] | None) -> dict[str, Topic]:
    """Read topics by name, those of them that the file has, or all; a damaged file gives one line."""
    if wanted is None:
        wanted = whole_contents(path, ()).topics
    contents = whole_contents(path, wanted)
    found = {}
    for topic, payloads in contents.payloads.items():
        encoding, schema = contents.format_of(topic)
        name, definition = (schema.name, schema.data) if schema else ("", b"")
        with named_errors(f"{path} topic {topic}"):
            if encoding == "json":
                messages = [parse_json(one.decode(), LARGEST_FIELD) for one in payloads]
            elif encoding == "protobuf":
                messages = list(map(_protobuf(name, definition), payloads))
            elif encoding in ("cdr", "ros1"):
                messages = payloads
            else:
                raise InputError(f"has {encoding!r} messages: JSON, Protobuf and ROS are read")
            kind = encoding if messages is payloads else ""
            text = definition.decode(errors="replace") if kind else ""
        found[topic] = Topic(contents.times[topic], messages, kind, name, text)
    return found


def _protobuf(name: str, schema: bytes) -> Callable[[bytes], Any]:
    """Return the decoder of the messages of a Protobuf type, by its descriptors."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    decode: Callable[[bytes], Any] = message_factory.GetMessageClass(
        pool.FindMessageTypeByName(name)
    ).FromString
    return decode
