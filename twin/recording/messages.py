"""How an episode maps to Protobuf messages on topics, and back.

Degrees and millimetres are on the side of the messages, SI units on the side of the episode: this is the only
place of the recording that converts them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from numpy.typing import NDArray

from twin.episode import OPTIONAL, Episode
from twin.recording.endotwin_pb2 import Command, Measurement, Tension, Truth  # type: ignore[attr-defined]
from twin.recording.poses import LATERAL_HINGE, joint_states, link_length, transforms

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

    A measurement that is missing is no message. `/tension` is left out without wire tensions,
    `/joint_states` without joints, and `/tf` also without a preset in the metadata that tells the geometry.

    Yields:
        Topic, nanoseconds, message. The message is valid until the next one is asked for: it is the same
        object for every sample of a topic, as building nested transforms anew each time would cost most.

    Raises:
        ValueError: times or shapes do not fit the messages, or no measurement is there.
    """
    nanoseconds = to_nanoseconds(episode.time)
    _check_shapes(episode)
    missing = np.isnan(episode.measured_bend)
    if missing.all():
        raise ValueError("measured_bend is NaN at every sample: a record needs a measurement")
    streams: dict[str, Iterator[Any]] = {
        "/command": _samples(Command(), _command_columns(episode)),
        "/truth": _samples(Truth(), _truth_columns(episode)),
        "/measurement": _samples(Measurement(), {"bend_deg": episode.measured_bend_deg}),
    }
    if episode.wire_tension.shape[2] > 0:
        tensions = {f"tension_{name}_n": episode.tension[:, wire] for wire, name in _wires_of(episode)}
        streams["/tension"] = _samples(Tension(), tensions)
    if episode.joint_angle.shape[1] > 0:
        streams["/joint_states"] = joint_states(episode, nanoseconds)
        link = link_length(episode)
        if link is not None:
            streams["/tf"] = transforms(episode, nanoseconds, link)
    for time, unseen, *messages in zip(nanoseconds, missing.tolist(), *streams.values(), strict=True):
        for topic, message in zip(streams, messages, strict=True):
            if not (unseen and topic == "/measurement"):
                yield topic, time, message


def decode(times: Mapping[str, Sequence[int]], payloads: Mapping[str, Sequence[bytes]]) -> dict[str, Array]:
    """Return the arrays of an episode, by field name, from the serialised messages of each topic.

    Args:
        times: nanoseconds of the messages of each topic.
        payloads: the messages of each topic, in the same order.

    Returns:
        Arrays in SI units, with zero columns for wire tensions, friction or joints that were not recorded;
        other optional fields (`episode.OPTIONAL`) that were not are empty or left out. `measured_bend` is NaN
        at each sample without a message of `/measurement`.

    Raises:
        ValueError: a topic is missing, topics differ in their times (`/measurement` may have fewer), or
            messages of a topic differ in what they hold.
        google.protobuf.message.DecodeError: a payload is not the message that its topic holds.
    """
    for topic in REQUIRED_TOPICS:
        if topic not in times:
            raise ValueError(f"topic {topic} is missing")
    count = len(times["/command"])
    for topic in SCHEMAS:
        if topic not in times or topic == "/measurement":
            continue
        if len(times[topic]) != count:
            raise ValueError(f"topic {topic} has {len(times[topic])} messages, /command has {count}")
        if list(times[topic]) != list(times["/command"]):
            raise ValueError(f"the messages of {topic} are not at the times of those of /command")

    commands = [Command.FromString(payload) for payload in payloads["/command"]]
    truths = [Truth.FromString(payload) for payload in payloads["/truth"]]
    measurements = [Measurement.FromString(payload) for payload in payloads["/measurement"]]
    joints = [JointStates.FromString(payload).joints for payload in payloads.get("/joint_states", [])]
    measured_bend = np.full(count, np.nan)
    measured_bend[_places(times["/measurement"], times["/command"])] = np.radians(
        [message.bend_deg for message in measurements]
    )
    arrays = {
        "time": np.array(times["/command"], dtype=float) / 1e9,
        "pull": np.array([message.pull_mm for message in commands]) / 1e3,
        "bend": np.radians([message.bend_deg for message in truths]),
        "measured_bend": measured_bend,
        "joint_angle": _hinges("joints", joints, count, lateral=False),
        "pulley": _optional(truths, "pulley_mm") / 1e3,
        "sheath_bend": np.radians(_optional(truths, "sheath_bend_deg")),
    }
    lateral = {
        "lateral_pull": _optional(commands, "lateral_pull_mm") / 1e3,
        "lateral_bend": np.radians(_optional(truths, "lateral_bend_deg")),
    }
    sideways = _hinges("lateral joints", joints, count, lateral=True)
    if sideways.shape[1] not in (0, arrays["joint_angle"].shape[1]):
        sizes = arrays["joint_angle"].shape[1], sideways.shape[1]
        raise ValueError(f"/joint_states has {sizes[0]} hinges, {sizes[1]} lateral ones")
    if sideways.shape[1] > 0:
        lateral["lateral_joint_angle"] = sideways
    wires = _wire_names(lateral.values())
    return (
        arrays | lateral | {name: _wires(truths, name, wires) for name in ("wire_tension", "sheath_friction")}
    )


def _places(measurements: Sequence[int], commands: Sequence[int]) -> list[int]:
    """Index among the times of the commands of each of the measurements', of which some may be missing."""
    index = {time: place for place, time in enumerate(commands)}
    places = [index.get(time, -1) for time in measurements]
    if any(place <= before for before, place in zip([-1, *places], places, strict=False)):
        raise ValueError("the messages of /measurement are not at the times of those of /command")
    return places


def _wire_names(lateral: Iterable[Array]) -> str:
    """Which wires there are: c and d where anything sideways was recorded."""
    return "abcd" if any(values.size > 0 for values in lateral) else "ab"


def _wires_of(episode: Episode) -> Iterator[tuple[int, str]]:
    """Yield index and name of each wire."""
    return enumerate(_wire_names((episode.lateral_pull, episode.lateral_bend, episode.lateral_joint_angle)))


def _check_shapes(episode: Episode) -> None:
    count, wires = len(episode.time), len(list(_wires_of(episode)))
    for field, columns, valid in (
        ("pull", (), "(N,)"),
        ("bend", (), "(N,)"),
        ("measured_bend", (), "(N,)"),
        ("joint_angle", (None,), "(N, vertebrae)"),
        ("wire_tension", (wires, None), f"(N, {wires}, elements + 1)"),
        ("sheath_friction", (wires, None), f"(N, {wires}, elements)"),
        ("pulley", (), "(N,)"),
        ("sheath_bend", (), "(N,)"),
        ("lateral_pull", (), "(N,)"),
        ("lateral_bend", (), "(N,)"),
        ("lateral_joint_angle", np.shape(episode.joint_angle)[1:], "as joint_angle"),
    ):
        shape = np.shape(getattr(episode, field))
        if field in OPTIONAL and shape == (0,):
            continue
        fits = len(shape) == 1 + len(columns) and all(
            wanted is None or size == wanted for size, wanted in zip(shape[1:], columns, strict=True)
        )
        if not fits:
            raise ValueError(f"{field} has shape {shape} for {count} samples: must be {valid}")


def _command_columns(episode: Episode) -> dict[str, Array]:
    return _recorded({"pull_mm": episode.pull_mm, "lateral_pull_mm": episode.lateral_pull * 1e3})


def _truth_columns(episode: Episode) -> dict[str, Array]:
    columns = {
        "bend_deg": episode.bend_deg,
        "lateral_bend_deg": np.degrees(episode.lateral_bend),
        "pulley_mm": episode.pulley * 1e3,
        "sheath_bend_deg": np.degrees(episode.sheath_bend),
    }
    for wire, name in _wires_of(episode):
        columns[f"wire_tension_{name}_n"] = episode.wire_tension[:, wire]
        columns[f"sheath_friction_{name}_n"] = episode.sheath_friction[:, wire]
    return _recorded(columns)


def _recorded(columns: dict[str, Array]) -> dict[str, Array]:
    return {name: values for name, values in columns.items() if len(values) > 0}


def _samples(message: Any, columns: dict[str, Array]) -> Iterator[Any]:
    """Yield a message at each sample; its fields are the numbers, or the rows of numbers, of the columns."""
    rows = zip(*(np.asarray(values, dtype=float).tolist() for values in columns.values()), strict=True)
    for row in rows:
        for field, value in zip(columns, row, strict=True):
            if isinstance(value, list):
                getattr(message, field)[:] = value
            else:
                setattr(message, field, value)
        yield message


def _optional(messages: list[Any], field: str) -> Array:
    """(N,) of a field that all messages have; (0,) if none has it."""
    known = [message.HasField(field) for message in messages]
    if not any(known):
        return np.empty(0)
    if not all(known):
        raise ValueError(f"{field} is missing at sample {known.index(False)}, not at {known.index(True)}")
    return np.array([getattr(message, field) for message in messages])


def _hinges(name: str, joints: list[Any], count: int, *, lateral: bool) -> Array:
    """(count, columns) of the angles of the hinges that bend it sideways, or of the others."""
    rows = [
        [joint.position for joint in row if joint.name.startswith(LATERAL_HINGE) is lateral] for row in joints
    ]
    return _table(name, rows, count)


def _wires(truths: list[Any], quantity: str, wires: str) -> Array:
    """(N, wires, columns) of a quantity that all wires have."""
    tables = {
        name: _table(
            f"{quantity}_{name}_n",
            [getattr(message, f"{quantity}_{name}_n") for message in truths],
            len(truths),
        )
        for name in "abcd"
    }
    for name, table in tables.items():
        if name not in wires and table.shape[1] > 0:
            raise ValueError(f"{quantity}_{name}_n is recorded, but no lateral pull, bend or joints")
        if name in wires and table.shape != tables["a"].shape:
            sizes = tables["a"].shape[1], table.shape[1]
            raise ValueError(f"{quantity}_a_n has {sizes[0]} columns, {quantity}_{name}_n has {sizes[1]}")
    return np.stack([tables[name] for name in wires], axis=1)


def _table(name: str, rows: Sequence[Sequence[float]], count: int) -> Array:
    """(count, columns) of rows that must be equally long; no columns if there are no rows."""
    columns = len(rows[0]) if rows else 0
    for index, row in enumerate(rows):
        if len(row) != columns:
            raise ValueError(f"{name} has {len(row)} values at sample {index}, {columns} at sample 0")
    return np.array([list(row) for row in rows], dtype=float).reshape(count, columns)
