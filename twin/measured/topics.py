"""Messages of topics as columns: bags of ROS 1 and ROS 2, and MCAP files of other software.

A column is a field that holds a number, `/topic.field.of.field` or `/topic.field[2]`; a row is a message, at
the time at which it was recorded. Definitions of ROS types are read as data, no code is made of them.
"""

import dataclasses
import struct
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.recording.foreign import Topic, read_topics
from twin.recording.reader import named_errors

Array = NDArray[np.float64]
TIME = "time_s"
MOST_ELEMENTS = 32  # of a list, that become columns
MOST_DEPTH = 16  # of messages in messages
MOST_MESSAGES = 10_000_000
_FORMATS = {"bool": "?", "byte": "B", "char": "b", "octet": "B", "float32": "f", "float64": "d"} | {
    f"{sign}int{8 * size}": letter.upper() if sign else letter
    for sign in ("", "u")
    for size, letter in ((1, "b"), (2, "h"), (4, "i"), (8, "q"))
}


def topic_columns(path: Path, names: Collection[str] | None) -> dict[str, Array]:
    """Return the columns of some names that a file has, or all, and the time [s] from the first message on.

    Rows are those of all topics that have one of the columns; a message has no values in columns of others.
    """
    wanted = None
    if names is not None:  # the topic is the name up to one of its points
        wanted = {name[:at] for name in names for at, mark in enumerate(name) if mark == "."}
    is_mcap = path.suffix.lower() == ".mcap"
    topics = read_topics(path, wanted) if is_mcap else _bag_topics(path, wanted)
    stamps: list[int] = []
    values: dict[str, list[float]] = {}
    for topic, read in topics.items():
        begin = len(stamps)
        with named_errors(f"{path} topic {topic}"):
            fields = _ros_fields(read) if read.kind else _fields
            for message in read.messages:
                held = False
                for field, value in fields(message):
                    name = topic + field
                    if names is None or name in names:
                        column = values.setdefault(name, [])
                        column += [np.nan] * (len(stamps) - len(column))
                        column.append(value)
                        held = True
                if held:
                    stamps.append(read.times[len(stamps) - begin])
    if len(stamps) > MOST_MESSAGES:
        raise InputError(f"{path} has {len(stamps)} messages: at most {MOST_MESSAGES} are read")
    time = np.array(stamps, np.int64)
    order = np.argsort(time, kind="stable")
    columns = {}
    for name, column in values.items():
        column += [np.nan] * (len(stamps) - len(column))
        columns[name] = np.array(column)[order]
    return {TIME: (time[order] - time.min(initial=2**62)) * 1e-9, **columns}


def _bag_topics(path: Path, wanted: Collection[str] | None) -> dict[str, Topic]:
    """Read the topics of a bag of ROS 1, a file, or of ROS 2, a folder or its file."""
    from rosbags.rosbag1 import Reader as Ros1Reader
    from rosbags.rosbag2 import Reader as Ros2Reader

    kind = "ros1" if path.suffix.lower() == ".bag" else "cdr"
    found: dict[str, Topic] = {}
    with named_errors(f"{path}"), (Ros1Reader if kind == "ros1" else Ros2Reader)(path) as bag:
        chosen = [one for one in bag.connections if wanted is None or one.topic in wanted]
        for connection, time, payload in bag.messages(connections=chosen) if chosen else ():
            if connection.topic not in found:
                text = connection.msgdef.data
                found[connection.topic] = Topic([], [], kind, connection.msgtype, text)
            found[connection.topic].times.append(time)
            found[connection.topic].messages.append(bytes(payload))
    return found


def _fields(message: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield the names and values of the numbers in a message of JSON or Protobuf."""
    if isinstance(message, (bool, int, float)):
        yield prefix, float(message)
    elif depth < MOST_DEPTH and isinstance(message, Mapping):
        for name, value in message.items():
            yield from _fields(value, f"{prefix}.{name}", depth + 1)
    elif depth < MOST_DEPTH and hasattr(message, "DESCRIPTOR"):
        for field in message.DESCRIPTOR.fields:
            yield from _fields(getattr(message, field.name), f"{prefix}.{field.name}", depth + 1)
    elif depth < MOST_DEPTH and hasattr(message, "__len__") and not isinstance(message, (str, bytes)):
        for place, value in enumerate(message[:MOST_ELEMENTS]):
            yield from _fields(value, f"{prefix}[{place}]", depth + 1)


def _ros_fields(topic: Topic) -> Callable[[bytes], Iterator[tuple[str, float]]]:
    """Return what yields the names and values of the numbers in a message of ROS."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    types = dict(get_typestore(Stores.ROS1_NOETIC if topic.kind == "ros1" else Stores.LATEST).fielddefs)
    is_idl = "IDL: " in topic.definition[:200] or "module " in topic.definition[:200]
    if topic.definition:
        given = topic.definition, topic.type_name
        types |= get_types_from_idl(given[0].split("\n", 2)[2]) if is_idl else get_types_from_msg(*given)
    name = topic.type_name if "/msg/" in topic.type_name else topic.type_name.replace("/", "/msg/", 1)

    def decode(payload: bytes) -> Iterator[tuple[str, float]]:
        reading = _Ros(payload, types, topic.kind == "cdr")
        reading.read_type(name, "", 0)
        return iter(reading.found)

    return decode


@dataclasses.dataclass
class _Ros:
    """Reads the numbers of one message, as ROS 1 writes them or, with aligned values, CDR of ROS 2."""

    payload: bytes
    types: Mapping[str, Any]
    aligned: bool

    def __post_init__(self) -> None:
        self.found: list[tuple[str, float]] = []
        self.begin = self.at = 4 if self.aligned else 0  # CDR has a header, from the end of which it aligns
        self.order = ">" if self.aligned and self.payload[1] == 0 else "<"

    def number(self, letter: str) -> Any:
        size = struct.calcsize(f"={letter}")
        if self.aligned:
            self.at += -(self.at - self.begin) % size
        (value,) = struct.unpack_from(self.order + letter, self.payload, self.at)
        self.at += size
        return value

    def read_type(self, name: str, prefix: str, depth: int) -> None:
        """Read a message of a type."""
        if depth > MOST_DEPTH:
            raise InputError(f"holds messages more than {MOST_DEPTH} deep")
        _, fields = self.types[name]
        for field, kind in fields:
            self.read(kind, f"{prefix}.{field}", depth, keep=True)
        if self.aligned and not fields:
            self.at += 1  # CDR knows no empty messages

    def read(self, kind: Any, name: str, depth: int, *, keep: bool) -> None:
        """Read a number, text, message or list."""
        node, what = kind[0].name, kind[1]
        if node == "NAME":
            self.read_type(what, name, depth + 1)
        elif node == "BASE" and what[0] in ("string", "wstring"):
            length = self.number("I")
            self.at += length * (2 if what[0] == "wstring" else 1)
        elif node == "BASE":
            value = self.number(_FORMATS[what[0]])
            if keep:
                self.found.append((name, float(value)))
        else:
            element, count = what
            count = count if node == "ARRAY" else self.number("I")
            if count > len(self.payload):
                raise InputError(f"{name[1:]} claims {count} elements")
            for place in range(count):
                self.read(element, f"{name}[{place}]", depth, keep=keep and place < MOST_ELEMENTS)
