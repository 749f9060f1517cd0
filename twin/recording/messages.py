"""Messages of an episode and of its estimates: schemas, an episode as message streams, and decoding back.

Degrees and millimetres are on the side of the messages, SI units on the side of the episode: this is the only
place of the recording that converts them.
"""

import dataclasses
import functools
import itertools
import math
import operator
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from numpy.typing import ArrayLike, NDArray

from twin.episode import OPTIONAL, WIRES, Episode, without_holes
from twin.errors import InputError
from twin.recording.chunks import Stream
from twin.recording.endotwin_pb2 import Command, Estimate, Measurement, Tension, Truth
from twin.recording.endotwin_pb2 import Health as HealthMessage
from twin.recording.features import FEATURES, refuse_implausible
from twin.recording.scene import (
    LATERAL_HINGE,
    hinge_angles,
    joint_states,
    link_length,
    rotations,
    scene,
    transforms,
)

if TYPE_CHECKING:
    from twin.live.reading import Reading

Array = NDArray[np.float64]
HEALTH_TOPIC = "/health"  # faults that a running estimator found in a sample
ESTIMATE_PREFIX = "/estimate/"  # of the topics of estimators
REFERENCE_TOPIC = "/reference"  # angles that a controller was to follow, as messages of `Estimate`
SCENE_TOPIC = "/scene"  # topic of the one message that draws the endoscope; it is not read back

SCHEMAS: dict[str, Any] = {
    "/command": Command,
    "/truth": Truth,
    "/measurement": Measurement,
    "/tension": Tension,
    "/joint_states": JointStates,
    "/tf": FrameTransforms,
    SCENE_TOPIC: SceneUpdate,
}
"""Message class of each topic of an episode."""

TRUTH_TOPIC = "/truth"  # topic of the true angle and the hidden state; a live recording has none
LARGEST_TIME = 2**63 - 1  # [ns] MCAP could hold twice that; signed clocks of its readers could not


def required_topics(*, measured: bool) -> tuple[str, ...]:
    """Return the topics that an episode must have; of a real endoscope, the truth may not be known."""
    return ("/command", "/measurement") if measured else ("/command", TRUTH_TOPIC, "/measurement")


def to_nanoseconds(time: Array) -> list[int]:
    """Convert increasing times (N,) [s] to integers (N,) [ns]."""
    rounded = np.rint(np.asarray(time, dtype=float) * 1e9)
    if rounded[0] < 0 or rounded[-1] > LARGEST_TIME:
        raise InputError(f"time runs from {time[0]:g} to {time[-1]:g} s: a log time is from 0 to 9.2e9 s")
    nanoseconds = rounded.astype(np.int64)
    same = np.flatnonzero(np.diff(nanoseconds) <= 0)
    if len(same) > 0:
        raise InputError(f"time at sample {same[0] + 1} is less than 1 ns after the one before")
    return cast(list[int], nanoseconds.tolist())


def decode(
    times: Mapping[str, Sequence[int]],
    payloads: Mapping[str, Sequence[bytes]],
    *,
    hidden: bool = True,
    measured: bool = False,
) -> dict[str, Array]:
    """Decode the messages of each topic, at log times [ns], into the arrays of an episode, by field name.

    They are in SI units; what was not recorded has no columns, is empty or left out. Without `hidden`, wires
    are left out. A `measured` record may have no `/truth`: `bend` is then the measured angle, linear where it
    is missing and level at the ends. `measured_bend` is NaN without a message of `/measurement`.
    """
    for topic in required_topics(measured=measured):
        if topic not in times:
            raise InputError(f"topic {topic} is missing")
    count = len(times["/command"])
    if max(times["/command"], default=0) > LARGEST_TIME:
        raise InputError(f"a log time is {max(times['/command'])} ns: must be at most {LARGEST_TIME}")
    for topic in SCHEMAS:
        if topic not in times or topic in ("/measurement", SCENE_TOPIC):
            continue
        if len(times[topic]) != count:
            raise InputError(f"topic {topic} has {len(times[topic])} messages, /command has {count}")
        if list(times[topic]) != list(times["/command"]):
            raise InputError(f"the messages of {topic} are not at the times of those of /command")

    commands = [Command.FromString(payload) for payload in payloads["/command"]]
    truths = [Truth.FromString(payload) for payload in payloads.get(TRUTH_TOPIC, [])]
    measurements = [Measurement.FromString(payload) for payload in payloads["/measurement"]]
    joints = [JointStates.FromString(payload).joints for payload in payloads.get("/joint_states", [])]
    own, sideways = _hinges(joints, count)
    measured_bend = np.full(count, np.nan)
    measured_bend[places_of(times["/measurement"], times["/command"], "/measurement")] = np.radians(
        [message.measured_deg for message in measurements]
    )
    time = np.array(times["/command"], dtype=float) / 1e9
    known = np.radians([message.truth_deg for message in truths])
    arrays = {
        "time": time,
        "pull": np.array([message.pull_mm for message in commands]) / 1e3,
        "bend": known if len(truths) == count else without_holes(time, measured_bend),
        "measured_bend": measured_bend,
        "joint_angle": own,
        "pulley": _optional(truths, "pulley_mm") / 1e3,
        "sheath_bend": np.radians(_optional(truths, "sheath_bend_deg")),
    }
    lateral = {
        "lateral_pull": _optional(commands, "lateral_pull_mm") / 1e3,
        "lateral_bend": np.radians(_optional(truths, "lateral_bend_deg")),
    }
    if sideways.shape[1] not in (0, arrays["joint_angle"].shape[1]):
        sizes = arrays["joint_angle"].shape[1], sideways.shape[1]
        raise InputError(f"/joint_states has {sizes[0]} hinges, {sizes[1]} lateral ones")
    if sideways.shape[1] > 0:
        lateral["lateral_joint_angle"] = sideways
    wires = WIRES if any(values.size > 0 for values in lateral.values()) else WIRES[:2]
    if not hidden or not truths:
        nothing = np.empty((count, len(wires), 0))
        return arrays | lateral | {"wire_tension": nothing, "sheath_friction": nothing}
    slack_mm = _wires(truths, "wire_slack_{}_mm", wires)
    if slack_mm.shape[2] > 0:
        arrays["wire_slack"] = slack_mm / 1e3
    arrays["wire_tension"] = _wires(truths, "wire_tension_{}_n", wires)
    arrays["sheath_friction"] = _wires(truths, "sheath_friction_{}_n", wires)
    return arrays | lateral


def estimate_topic(method: str) -> str:
    """Return the topic of a method's estimates: `/estimate/` and its name, in letters, digits, - and _."""
    return ESTIMATE_PREFIX + re.sub(r"[^A-Za-z0-9-]+", "_", method).strip("_")


def estimate_message(estimate_deg: float, low_deg: float = math.nan, high_deg: float = math.nan) -> Any:
    """Return a message of one estimate; an end of its 95 % interval is left out unless it is finite."""
    ends = {"low_deg": low_deg, "high_deg": high_deg}
    return Estimate(
        estimate_deg=estimate_deg, **{name: end for name, end in ends.items() if math.isfinite(end)}
    )


def health_message(reading: "Reading") -> Any:
    """Return a message of the health of one sample: faults and alarms by name, and the source."""
    return HealthMessage(
        faults=[str(fault.name).lower() for fault in reading.health],
        alarms=[str(alarm.name).lower() for alarm in reading.alarms],
        source=reading.source.value,
    )


def places_of(times: Sequence[int], commands: Sequence[int], topic: str) -> list[int]:
    """Return the index of each message's time among those of the commands; some may have no message."""
    index = {time: place for place, time in enumerate(commands)}
    places = [index.get(time, -1) for time in times]
    if any(place <= before for before, place in zip([-1, *places], places, strict=False)):
        raise InputError(f"the messages of {topic} are not at the times of those of /command")
    return places


def _optional(messages: list[Any], field: str) -> Array:
    """Return an optional field as (N,) if all messages have it, (0,) if none has it."""
    known = [message.HasField(field) for message in messages]
    if not any(known):
        return np.empty(0)
    if not all(known):
        raise InputError(f"{field} is missing at sample {known.index(False)}, not at {known.index(True)}")
    return np.array([getattr(message, field) for message in messages])


def _hinges(joints: list[Any], count: int) -> tuple[Array, Array]:
    own, lateral = [], []
    for row in joints:
        angles = [(joint.name.startswith(LATERAL_HINGE), joint.position) for joint in row]
        own.append([angle for sideways, angle in angles if not sideways])
        lateral.append([angle for sideways, angle in angles if sideways])
    return _table("joints", own, count), _table("lateral joints", lateral, count)


def _wires(truths: list[Any], field: str, wires: str) -> Array:
    """Return a field of all wires as (N, wires, columns); `{}` in its name stands for the wire."""
    tables = {}
    for name in WIRES:
        of_wire = field.format(name)
        tables[name] = _table(of_wire, list(map(operator.attrgetter(of_wire), truths)), len(truths))
    for name, table in tables.items():
        if name not in wires and table.shape[1] > 0:
            raise InputError(f"{field.format(name)} is recorded, but no lateral pull, bend or joints")
        if name in wires and table.shape != tables["a"].shape:
            sizes = tables["a"].shape[1], table.shape[1]
            raise InputError(
                f"{field.format('a')} has {sizes[0]} columns, {field.format(name)} has {sizes[1]}"
            )
    return np.stack([tables[name] for name in wires], axis=1)


def _table(name: str, rows: Sequence[Sequence[float]], count: int) -> Array:
    """Stack rows of equal length into (count, columns); no columns if there are no rows."""
    sizes = list(map(len, rows))
    columns = sizes[0] if sizes else 0
    if sizes.count(columns) < len(sizes):
        index = next(index for index, size in enumerate(sizes) if size != columns)
        raise InputError(f"{name} has {sizes[index]} values at sample {index}, {columns} at sample 0")
    if columns == 0:
        return np.empty((count, 0))
    return np.fromiter(itertools.chain.from_iterable(rows), float, columns * count).reshape(count, columns)


def streams_of(episode: Episode, start: int) -> list[Stream]:
    """Return the message streams of an episode, one for each topic."""
    _check_shapes(episode)
    refuse_implausible(episode)
    seen = ~np.isnan(episode.measured_bend)
    if not seen.any():
        raise InputError("measured_bend is NaN at every sample: a record needs a measurement")
    streams = []
    for topic in ("/command", TRUTH_TOPIC, "/measurement", "/tension"):
        if columns := _columns(episode, topic):
            present = seen if topic == "/measurement" else np.ones(len(seen), bool)
            streams.append(_scalars(topic, columns, present))
    if episode.joint_angle.shape[1] > 0:
        streams += _pose_streams(episode)
    drawing = scene(episode, start)
    if drawing is not None:
        first = np.arange(len(episode.time)) == 0
        streams.append(Stream(SCENE_TOPIC, lambda row, nanoseconds: drawing, _stacked([], len(first)), first))
    return streams


def _columns(episode: Episode, topic: str) -> dict[str, Array]:
    wires = episode.wire_names
    columns: dict[str, Array] = {}
    for feature in FEATURES:
        values = feature.values(episode)
        if feature.topic != topic or len(values) == 0:
            continue
        if "*" in feature.field:
            columns |= {feature.field.replace("*", name): values[:, k] for k, name in enumerate(wires)}
        else:
            columns[feature.field] = values
    return columns


def _scalars(topic: str, columns: dict[str, Array], present: NDArray[np.bool_]) -> Stream:
    sizes = {field: values.shape[1] if values.ndim == 2 else None for field, values in columns.items()}

    def build(row: Sequence[float], nanoseconds: int) -> Any:
        message, first = SCHEMAS[topic](), 0
        for field, size in sizes.items():
            if size is None:
                setattr(message, field, row[first])
            else:
                getattr(message, field)[:] = row[first : first + size]
            first += 1 if size is None else size
        return message

    return Stream(topic, build, _stacked(list(columns.values()), len(present)), present)


def _pose_streams(episode: Episode) -> list[Stream]:
    angles, link, every = hinge_angles(episode), link_length(episode), np.ones(len(episode.time), bool)
    joints = functools.partial(joint_states, list(angles))
    streams = [Stream("/joint_states", joints, _stacked(list(angles.values()), len(every)), every)]
    if link is not None:
        parts = rotations(episode)
        frames = functools.partial(transforms, link, list(parts))
        streams.append(Stream("/tf", frames, _stacked(list(parts.values()), len(every)), every))
    return streams


def _stacked(columns: Sequence[ArrayLike], count: int) -> Array:
    tables = [np.asarray(values, dtype=float).reshape(count, -1) for values in columns]
    return np.hstack(tables) if tables else np.empty((count, 0))


def _check_shapes(episode: Episode) -> None:
    count, wires = len(episode.time), len(episode.wire_names)
    axes: dict[str, tuple[int | None, ...]] = {
        "joint_angle": (None,),
        "wire_tension": (wires, None),
        "sheath_friction": (wires, None),
        "wire_slack": (wires, None),
        "lateral_joint_angle": np.shape(episode.joint_angle)[1:],
    }
    for field in dataclasses.fields(Episode)[1:]:
        shape, wanted = np.shape(getattr(episode, field.name)), axes.get(field.name, ())
        if field.name in ("metadata", "attachments") or (field.name in OPTIONAL and shape == (0,)):
            continue
        fits = len(shape) == 1 + len(wanted) and all(
            right is None or size == right for size, right in zip(shape[1:], wanted, strict=True)
        )
        if not fits:
            valid = ", ".join(["N", *("any" if right is None else str(right) for right in wanted)])
            raise InputError(f"{field.name} has shape {shape} for {count} samples: must be ({valid})")
