"""Message streams of an episode, topic by topic, with numbers in the units of the messages.

`messages.decode` is the way back. Degrees and millimetres are on the side of the messages, SI units on the
side of the episode: these two are the only places of the recording that convert them.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.episode import OPTIONAL, Episode
from twin.errors import InputError
from twin.recording.endotwin_pb2 import Command, Measurement, Tension, Truth
from twin.recording.mcap_file.layout import Stream
from twin.recording.messages import SCENE_TOPIC, wire_names
from twin.recording.poses import hinge_angles, joint_states, link_length, rotations, transforms
from twin.recording.scene import scene

Array = NDArray[np.float64]


def streams_of(episode: Episode, start: int) -> list[Stream]:
    """Return the message streams of an episode, one for each topic.

    A measurement that is missing is no message. `/tension` is left out without wire tensions,
    `/joint_states` without joints, and `/tf` also without a preset in the metadata that states the geometry.
    `/scene` has one message, at the first sample, where the preset states the geometry.

    Args:
        episode: N samples.
        start: nanoseconds of the first sample.

    Raises:
        ValueError: shapes do not fit the messages, or no measurement is there.
    """
    _check_shapes(episode)
    seen = ~np.isnan(episode.measured_bend)
    if not seen.any():
        raise InputError("measured_bend is NaN at every sample: a record needs a measurement")
    streams = [
        _scalars("/command", Command, _command_columns(episode)),
        _scalars("/truth", Truth, _truth_columns(episode)),
        _scalars("/measurement", Measurement, {"measured_deg": episode.measured_deg}, seen),
    ]
    if episode.wire_tension.shape[2] > 0:
        tensions = {f"tension_{name}_n": episode.tension[:, wire] for wire, name in _wires_of(episode)}
        streams.append(_scalars("/tension", Tension, tensions))
    if episode.joint_angle.shape[1] > 0:
        streams += _pose_streams(episode)
    drawing = scene(episode, start)
    if drawing is not None:
        first = np.arange(len(episode.time)) == 0
        streams.append(Stream(SCENE_TOPIC, lambda row, nanoseconds: drawing, _table([], len(first)), first))
    return streams


def _pose_streams(episode: Episode) -> list[Stream]:
    angles = hinge_angles(episode)
    names = list(angles)

    def joints(row: Sequence[float], nanoseconds: int) -> Any:
        return joint_states(names, row, nanoseconds)

    streams = [_stream("/joint_states", joints, list(angles.values()))]
    link = link_length(episode)
    if link is not None:
        parts = rotations(episode)

        def frames(row: Sequence[float], nanoseconds: int) -> Any:
            return transforms(link, list(parts), row, nanoseconds)

        streams.append(_stream("/tf", frames, list(parts.values())))
    return streams


def _scalars(
    topic: str, kind: Any, columns: dict[str, Array], present: NDArray[np.bool_] | None = None
) -> Stream:
    """Return the stream of a message whose fields are numbers, or rows of numbers, of the columns."""
    sizes = {field: values.shape[1] if values.ndim == 2 else None for field, values in columns.items()}

    def build(row: Sequence[float], nanoseconds: int) -> Any:
        message, first = kind(), 0
        for field, size in sizes.items():
            if size is None:
                setattr(message, field, row[first])
            else:
                getattr(message, field)[:] = row[first : first + size]
            first += 1 if size is None else size
        return message

    return _stream(topic, build, list(columns.values()), present)


def _stream(
    topic: str,
    build: Callable[[Sequence[float], int], Any],
    columns: list[Array],
    present: NDArray[np.bool_] | None = None,
) -> Stream:
    count = len(columns[0])
    return Stream(topic, build, _table(columns, count), np.ones(count, bool) if present is None else present)


def _table(columns: Sequence[ArrayLike], count: int) -> Array:
    """Stack columns (count,) and tables (count, some) side by side into (count, columns)."""
    tables = [np.asarray(values, dtype=float).reshape(count, -1) for values in columns]
    return np.hstack(tables) if tables else np.empty((count, 0))


def _command_columns(episode: Episode) -> dict[str, Array]:
    return _recorded({"pull_mm": episode.pull_mm, "lateral_pull_mm": episode.lateral_pull * 1e3})


def _truth_columns(episode: Episode) -> dict[str, Array]:
    columns = {
        "truth_deg": episode.truth_deg,
        "lateral_bend_deg": np.degrees(episode.lateral_bend),
        "pulley_mm": episode.pulley * 1e3,
        "sheath_bend_deg": np.degrees(episode.sheath_bend),
    }
    for wire, name in _wires_of(episode):
        columns[f"wire_tension_{name}_n"] = episode.wire_tension[:, wire]
        columns[f"sheath_friction_{name}_n"] = episode.sheath_friction[:, wire]
        if len(episode.wire_slack) > 0:
            columns[f"wire_slack_{name}_mm"] = episode.wire_slack[:, wire] * 1e3
    return _recorded(columns)


def _recorded(columns: dict[str, Array]) -> dict[str, Array]:
    return {name: values for name, values in columns.items() if len(values) > 0}


def _wires_of(episode: Episode) -> list[tuple[int, str]]:
    """Return the index and the name of each wire."""
    lateral = (episode.lateral_pull, episode.lateral_bend, episode.lateral_joint_angle)
    return list(enumerate(wire_names(lateral)))


def _check_shapes(episode: Episode) -> None:
    count, wires = len(episode.time), len(_wires_of(episode))
    for field, columns, valid in (
        ("pull", (), "(N,)"),
        ("bend", (), "(N,)"),
        ("measured_bend", (), "(N,)"),
        ("joint_angle", (None,), "(N, vertebrae)"),
        ("wire_tension", (wires, None), f"(N, {wires}, elements + 1)"),
        ("sheath_friction", (wires, None), f"(N, {wires}, elements)"),
        ("pulley", (), "(N,)"),
        ("sheath_bend", (), "(N,)"),
        ("wire_slack", (wires, None), f"(N, {wires}, elements + 1)"),
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
            raise InputError(f"{field} has shape {shape} for {count} samples: must be {valid}")
