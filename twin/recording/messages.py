"""How an episode maps to Protobuf messages on topics, and back.

Degrees and millimetres are on the side of the messages, SI units on the side of the episode: this is the only
place of the recording that converts them.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from numpy.typing import NDArray

from twin.episode import Episode
from twin.recording.endotwin_pb2 import Command, Measurement, Tension, Truth  # type: ignore[attr-defined]

Array = NDArray[np.float64]

SCHEMAS: dict[str, Any] = {
    "/command": Command,
    "/truth": Truth,
    "/measurement": Measurement,
    "/tension": Tension,
    "/joint_states": JointStates,
    "/tf": FrameTransforms,
}
"""Message class of each topic of an episode."""

REQUIRED_TOPICS = ("/command", "/truth", "/measurement")
"""Topics without which a file holds no episode; a measured log has no others."""

LARGEST_TIME = 2**63 - 1  # [ns] MCAP could hold twice that; signed clocks of its readers could not


def to_nanoseconds(time: Array) -> list[int]:
    """Return times as whole nanoseconds.

    Args:
        time: (N,) seconds, increasing.

    Returns:
        N nanoseconds, increasing.

    Raises:
        ValueError: a time is negative or beyond 292 years, or two samples fall on the same nanosecond.
    """
    nanoseconds = [round(second * 1e9) for second in np.asarray(time, dtype=float).tolist()]
    if nanoseconds[0] < 0 or nanoseconds[-1] > LARGEST_TIME:
        raise ValueError(f"time runs from {time[0]:g} to {time[-1]:g} s: a log time is from 0 to 9.2e9 s")
    for index in range(1, len(nanoseconds)):
        if nanoseconds[index] <= nanoseconds[index - 1]:
            raise ValueError(f"time at sample {index} is less than 1 ns after the one before")
    return nanoseconds


def encode(episode: Episode) -> Iterator[tuple[str, int, Any]]:
    """Yield the messages of an episode in the order of time.

    `/tension` is left out without wire tensions, `/joint_states` without joints, and `/tf` also without a
    preset in the metadata that tells the geometry.

    Yields:
        Topic, nanoseconds, message. The message is valid until the next one is asked for: it is the same
        object for every sample of a topic, as building nested transforms anew each time would cost most.

    Raises:
        ValueError: times or shapes do not fit the messages.
    """
    nanoseconds = to_nanoseconds(episode.time)
    _check_shapes(episode)
    streams: dict[str, Iterator[Any]] = {
        "/command": _scalars(Command(), "pull_mm", episode.pull_mm),
        "/truth": _truths(episode),
        "/measurement": _scalars(Measurement(), "bend_deg", episode.measured_bend_deg),
    }
    if episode.wire_tension.shape[2] > 0:
        streams["/tension"] = _tensions(episode)
    if episode.joint_angle.shape[1] > 0:
        streams["/joint_states"] = _joint_states(episode, nanoseconds)
        link = _link_length(episode)
        if link is not None:
            streams["/tf"] = _transforms(episode, nanoseconds, link)
    for time, *messages in zip(nanoseconds, *streams.values(), strict=True):
        for topic, message in zip(streams, messages, strict=True):
            yield topic, time, message


def decode(times: Mapping[str, Sequence[int]], payloads: Mapping[str, Sequence[bytes]]) -> dict[str, Array]:
    """Return the arrays of an episode, by field name, from the serialised messages of each topic.

    Args:
        times: nanoseconds of the messages of each topic.
        payloads: the messages of each topic, in the same order.

    Returns:
        Arrays in SI units, with zero columns for wire tensions, friction or joints that were not recorded.

    Raises:
        ValueError: a topic is missing, topics differ in their times, or messages of a topic differ in size.
        google.protobuf.message.DecodeError: a payload is not the message that its topic holds.
    """
    for topic in REQUIRED_TOPICS:
        if topic not in times:
            raise ValueError(f"topic {topic} is missing")
    count = len(times["/command"])
    for topic in SCHEMAS:
        if topic in times and len(times[topic]) != count:
            raise ValueError(f"topic {topic} has {len(times[topic])} messages, /command has {count}")
        if topic in times and list(times[topic]) != list(times["/command"]):
            raise ValueError(f"the messages of {topic} are not at the times of those of /command")

    commands = [Command.FromString(payload) for payload in payloads["/command"]]
    truths = [Truth.FromString(payload) for payload in payloads["/truth"]]
    measurements = [Measurement.FromString(payload) for payload in payloads["/measurement"]]
    joints = [JointStates.FromString(payload).joints for payload in payloads.get("/joint_states", [])]
    return {
        "time": np.array(times["/command"], dtype=float) / 1e9,
        "pull": np.array([message.pull_mm for message in commands]) / 1e3,
        "bend": np.radians([message.bend_deg for message in truths]),
        "measured_bend": np.radians([message.bend_deg for message in measurements]),
        "joint_angle": _table("joints", [[joint.position for joint in row] for row in joints], count),
        "wire_tension": _wires(truths, "wire_tension"),
        "sheath_friction": _wires(truths, "sheath_friction"),
    }


def _check_shapes(episode: Episode) -> None:
    count = len(episode.time)
    for field, columns, valid in (
        ("pull", (), "(N,)"),
        ("bend", (), "(N,)"),
        ("measured_bend", (), "(N,)"),
        ("joint_angle", (None,), "(N, vertebrae)"),
        ("wire_tension", (2, None), "(N, 2, elements + 1)"),
        ("sheath_friction", (2, None), "(N, 2, elements)"),
    ):
        shape = np.shape(getattr(episode, field))
        fits = len(shape) == 1 + len(columns) and all(
            wanted is None or size == wanted for size, wanted in zip(shape[1:], columns, strict=True)
        )
        if not fits:
            raise ValueError(f"{field} has shape {shape} for {count} samples: must be {valid}")


def _link_length(episode: Episode) -> float | None:
    """Length of one vertebra [m], or None where the metadata does not tell."""
    preset = episode.metadata.get("preset")
    if not isinstance(preset, Mapping) or not {"section_length", "vertebrae"} <= set(preset):
        return None
    joints = episode.joint_angle.shape[1]
    if preset["vertebrae"] != joints:
        raise ValueError(f"joint_angle has {joints} columns, the preset {preset['vertebrae']} vertebrae")
    return float(preset["section_length"]) / joints


def _scalars(message: Any, field: str, values: Array) -> Iterator[Any]:
    for value in np.asarray(values, dtype=float).tolist():
        setattr(message, field, value)
        yield message


def _truths(episode: Episode) -> Iterator[Any]:
    message = Truth()
    for bend, tension, friction in zip(
        np.asarray(episode.bend_deg, dtype=float).tolist(),
        np.asarray(episode.wire_tension, dtype=float).tolist(),
        np.asarray(episode.sheath_friction, dtype=float).tolist(),
        strict=True,
    ):
        message.bend_deg = bend
        message.wire_tension_a_n[:], message.wire_tension_b_n[:] = tension
        message.sheath_friction_a_n[:], message.sheath_friction_b_n[:] = friction
        yield message


def _tensions(episode: Episode) -> Iterator[Any]:
    message = Tension()
    for tension in np.asarray(episode.tension, dtype=float).tolist():
        message.tension_a_n, message.tension_b_n = tension
        yield message


def _joint_states(episode: Episode, nanoseconds: list[int]) -> Iterator[Any]:
    message = JointStates()
    joints = [message.joints.add(name=f"hinge_{index}") for index in range(episode.joint_angle.shape[1])]
    for time, angles in zip(nanoseconds, np.asarray(episode.joint_angle, dtype=float).tolist(), strict=True):
        _stamp(message.timestamp, time)
        for joint, angle in zip(joints, angles, strict=True):
            joint.position = angle
        yield message


def _transforms(episode: Episode, nanoseconds: list[int], link: float) -> Iterator[Any]:
    """Frames base -> vertebra_0 -> vertebra_1 ..., a link apart, each turned about (0, -1, 0) by a hinge."""
    message = FrameTransforms()
    frames = []
    for index in range(episode.joint_angle.shape[1]):
        frame = message.transforms.add(child_frame_id=f"vertebra_{index}")
        frame.parent_frame_id = f"vertebra_{index - 1}" if index else "base"
        frame.translation.x = link if index else 0.0
        frames.append((frame.timestamp, frame.rotation))
    half = np.asarray(episode.joint_angle, dtype=float) / 2
    for time, sines, cosines in zip(
        nanoseconds, (-np.sin(half)).tolist(), np.cos(half).tolist(), strict=True
    ):
        for (stamp, rotation), sine, cosine in zip(frames, sines, cosines, strict=True):
            _stamp(stamp, time)
            rotation.y = sine
            rotation.w = cosine
        yield message


def _stamp(timestamp: Any, nanoseconds: int) -> None:
    timestamp.seconds, timestamp.nanos = divmod(nanoseconds, 10**9)


def _wires(truths: list[Any], quantity: str) -> Array:
    """(N, 2, columns) of a quantity that both wires have."""
    a, b = (
        _table(name, [getattr(message, name) for message in truths], len(truths))
        for name in (f"{quantity}_a_n", f"{quantity}_b_n")
    )
    if a.shape != b.shape:
        raise ValueError(f"{quantity}_a_n has {a.shape[1]} columns, {quantity}_b_n has {b.shape[1]}")
    return np.stack([a, b], axis=1)


def _table(name: str, rows: Sequence[Sequence[float]], count: int) -> Array:
    """(count, columns) of rows that must be equally long; no columns if there are no rows."""
    columns = len(rows[0]) if rows else 0
    for index, row in enumerate(rows):
        if len(row) != columns:
            raise ValueError(f"{name} has {len(row)} values at sample {index}, {columns} at sample 0")
    return np.array([list(row) for row in rows], dtype=float).reshape(count, columns)
