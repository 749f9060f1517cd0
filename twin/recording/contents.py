"""Contents of an MCAP file: messages by topic, metadata, attachments, and the episode they make."""

import struct
from collections.abc import Collection
from typing import Any

from mcap.opcode import Opcode

from twin.episode import Episode
from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import parse_json
from twin.files.shown import shown
from twin.recording.mcap_file.records import HEAD, Budget, FileRecord, parse, unpack
from twin.recording.messages import SCHEMAS, decode, required_topics
from twin.recording.writer import METADATA_RECORD

PASSED_OVER = ("/scene", "/camera/")
"""Prefixes of the topics that only show an episode: they are not read back."""

TOPICS = frozenset(topic for topic in SCHEMAS if not topic.startswith(PASSED_OVER))
"""Topics that an episode is read from."""

JOINTS_TOPIC = "/joint_states"
"""Topic of the hinge angles."""

MOST_METADATA = 4 * MEBIBYTE
"""Characters of the metadata of an episode."""

_MESSAGE = struct.Struct(HEAD.format + "HIQQ")  # followed by channel, sequence, log time and publish time
_MESSAGE_FIELDS = _MESSAGE.size - HEAD.size  # [bytes]

_SMALLEST_JOINT_LIMIT = 1_000_000
_JOINT_TAGS = (b"\x12", b"\x92")  # one of them begins each joint of a JointStates: field 2, of known length

Found = dict[str, tuple[list[int], list[bytes]]]


class Contents:
    """Contents of an MCAP file that is read record by record."""

    def __init__(self, file_size: int, kept: Collection[str] = TOPICS) -> None:
        """Start with no contents.

        Args:
            file_size: bytes of the file, which bound what it may unpack to.
            kept: topics whose messages are kept; those of others are checked and counted.
        """
        self.times: dict[str, list[int]] = {}
        self.payloads: dict[str, list[bytes]] = {}
        self.items: dict[str, str] | None = None
        self.attachments: dict[str, bytes] = {}
        self.topics: dict[int, str] = {}
        self.counts = {"message": 0, "chunk": 0, "attachment": 0, "metadata": 0}
        self.file_size = file_size
        self._channels: dict[int, tuple[str, str, int]] = {}
        self._schemas: dict[int, str] = {}
        self._kept = kept
        self._budget = Budget(file_size)

    def add(self, data: bytes, record: FileRecord) -> Found:
        """Add one record of a file, with the records inside a chunk; other kinds are skipped.

        Returns:
            Times and payloads of the messages by topic, which are part of the contents now.

        Raises:
            Exception: the record is damaged, in one of many ways; nothing of its messages was taken in.
        """
        if record.opcode == Opcode.CHUNK:
            raw = unpack(parse(data, record), self._budget)
            found = self._add_inner(raw, 0, len(raw))
            self.counts["chunk"] += 1
            return found
        if record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            return self._add_inner(data, record.start, record.end)
        if record.opcode == Opcode.METADATA:
            metadata = parse(data, record)
            if metadata.name == METADATA_RECORD:
                self.items = metadata.metadata
            self.counts["metadata"] += 1
        elif record.opcode == Opcode.ATTACHMENT:
            attachment = parse(data, record)
            self.attachments[attachment.name] = attachment.data
            self.counts["attachment"] += 1
        return {}

    def _add_inner(self, raw: bytes, offset: int, end: int) -> Found:
        """Add records of the kinds that may be inside a chunk; this loop dominates the time of reading."""
        found: Found = {}
        places: dict[int, tuple[list[int], list[bytes]] | None] = {}
        count, others, limit = 0, 0, self._budget.records
        read_message, message_opcode = _MESSAGE.unpack_from, int(Opcode.MESSAGE)
        head_size, fields_size, message_size = HEAD.size, _MESSAGE_FIELDS, _MESSAGE.size
        while offset < end:
            if end - offset >= message_size:
                opcode, length, channel, _, time, _ = read_message(raw, offset)
            elif end - offset >= head_size:
                opcode, length = HEAD.unpack_from(raw, offset)
            else:
                raise InputError("the last record of a chunk is cut off")
            stop = offset + head_size + length
            count += 1
            if count > limit:
                raise InputError("its chunks hold more records than a file of this size may hold")
            if stop > end:
                raise InputError(f"a record claims {length} bytes: {end - offset - head_size} are left")
            if opcode == message_opcode:
                if length < fields_size:
                    raise InputError(f"a message has {length} bytes: must have {fields_size} or more")
                if channel not in places:
                    places[channel] = self._place(channel, found)
                place = places[channel]
                if place is not None:
                    place[0].append(time)
                    place[1].append(raw[offset + message_size : stop])
            else:
                others += 1
                if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._describe(raw, FileRecord(opcode, offset, offset + head_size, stop))
            offset = stop
        self.counts["message"] += count - others
        self._budget.records -= count
        for topic, (times, payloads) in found.items():
            self.times.setdefault(topic, []).extend(times)
            self.payloads.setdefault(topic, []).extend(payloads)
        return found

    def _place(self, channel: int, found: Found) -> tuple[list[int], list[bytes]] | None:
        """Return the lists for the messages of a channel; None if they are skipped."""
        if channel not in self.topics:
            raise InputError(f"a message is on channel {channel}, which is not described")
        topic = self.topics[channel]
        return found.setdefault(topic, ([], [])) if topic in self._kept else None

    def _describe(self, raw: bytes, record: FileRecord) -> None:
        """Add a schema or a channel; one that is repeated must be identical."""
        fields = parse(raw, record)
        if record.opcode == Opcode.SCHEMA:
            if self._schemas.setdefault(fields.id, fields.name) != fields.name:
                raise InputError(f"schema {fields.id} is both {self._schemas[fields.id]} and {fields.name}")
            return
        channel = (fields.topic, fields.message_encoding, fields.schema_id)
        if self._channels.setdefault(fields.id, channel) != channel:
            raise InputError(f"channel {fields.id} is described twice, differently")
        self.topics[fields.id] = fields.topic

    def metadata(self) -> dict[str, Any]:
        """Return the metadata of the episode.

        Raises:
            ValueError: the file has none, an item is not JSON, or a known one is not of its kind.
        """
        if self.items is None:
            raise InputError(f"metadata record {METADATA_RECORD!r} is missing")
        from twin.recording.facts import check_facts  # pydantic: loaded when a file is read

        size = sum(len(name) + len(text) for name, text in self.items.items())
        if size > MOST_METADATA:
            raise InputError(f"metadata has {size} characters: at most {MOST_METADATA}")
        metadata = {name: from_json(name, text) for name, text in self.items.items()}
        check_facts(metadata)
        return metadata

    def episode(self, metadata: dict[str, Any], *, hidden: bool = True) -> Episode:
        """Return the episode of the messages, with its hidden state or without.

        Raises:
            ValueError: a topic is missing or of another schema, or messages or arrays do not fit together.
            google.protobuf.message.DecodeError: a payload is not the message that its topic holds.
        """
        self.check_topics()
        self._check_joints()
        arrays = decode(self.times, self.payloads, hidden=hidden, measured=self.is_measured)
        return Episode(**arrays, metadata=metadata, attachments=self.attachments)

    @property
    def is_measured(self) -> bool:
        """True where the metadata says that a real endoscope left this file, live or in a log."""
        return (self.items or {}).get("source") == '"measured"'

    @property
    def required_topics(self) -> tuple[str, ...]:
        """Topics that the file must have to hold an episode."""
        return required_topics(measured=self.is_measured)

    def check_topics(self) -> None:
        """Check that the topics of an episode are described, with the right encoding and schema.

        Raises:
            ValueError: a topic is missing or of another schema.
        """
        for topic in self.required_topics:
            if topic not in self.topics.values():
                raise InputError(f"topic {topic} is missing")
        for topic in sorted({*self.topics.values()} & TOPICS):
            self.check_schema(topic, SCHEMAS[topic])

    def check_schema(self, topic: str, *kinds: Any) -> None:
        """Check that every channel of a topic has Protobuf messages of one of some classes.

        Raises:
            ValueError: one has another encoding or schema.
        """
        wanted = [kind.DESCRIPTOR.full_name for kind in kinds]
        for name, encoding, schema in self._channels.values():
            found = self._schemas.get(schema, "none")
            if name == topic and (encoding != "protobuf" or found not in wanted):
                raise InputError(
                    f"topic {topic} has {encoding!r} messages of schema {found}: "
                    f"must be 'protobuf' of {' or '.join(wanted)}"
                )

    def _check_joints(self) -> None:
        """Check the number of joints before decoding: an empty one of 2 bytes becomes an object of 100."""
        joints = sum(
            payload.count(tag) for payload in self.payloads.get(JOINTS_TOPIC, []) for tag in _JOINT_TAGS
        )
        if joints > max(_SMALLEST_JOINT_LIMIT, self.file_size):
            raise InputError("/joint_states has more joints than a file of this size may hold")


def from_json(name: str, text: str) -> Any:
    """Decode a JSON item of the metadata.

    Raises:
        ValueError: it is not JSON, or holds a number that is not finite.
    """
    try:
        return parse_json(text, MOST_METADATA)
    except ValueError as error:
        raise InputError(f"metadata {shown(name)} {error}") from error
