"""Quantities of an episode: the table of their names, units and topics, statistics, and CSV tables."""

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import WIRES, Episode
from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.signals.sensor import LARGEST_BEND_DEG, LARGEST_PULL_MM

Array = NDArray[np.float64]
TOLERANCE = 1e-7  # relative tolerance of statistics: nine digits of them are written
UNITS = {"mm": "mm", "deg": "deg", "rad": "rad", "n": "N"}  # unit of a quantity, by what its name ends in
LARGEST = {
    "pull_mm": LARGEST_PULL_MM,
    "lateral_pull_mm": LARGEST_PULL_MM,
    "measured_deg": 1e6,  # of a simulated sensor, noisy and scaled; `import` and `run` refuse less
} | {"mm": 10 * LARGEST_PULL_MM, "deg": 10 * LARGEST_BEND_DEG, "rad": 100.0, "N": 1e6}
"""Largest plausible magnitude of a quantity by its name, or by its unit: sections and servos overshoot."""
COMMAND_ANGLE = "command_deg"
"""The command as an angle of the preset's pulley: the one column that is no quantity of `FEATURES`."""

TABLE = ("pull_mm", "bend_deg", COMMAND_ANGLE, "tension_n", "lateral_pull_mm", "lateral_bend_deg")
"""Quantities of the table next to an episode, in the order of their columns, after `time_s`."""


@dataclasses.dataclass(frozen=True)
class Feature:
    """One quantity of an episode."""

    name: str  # ends in its unit
    topic: str  # topic of its messages
    meaning: str  # what it is, as the Protobuf comments and docs/dataset.md begin
    values: Callable[[Episode], Array]  # (N, ...) in its unit; empty where it was not recorded
    per_wire: bool = False  # each wire has a field of its own

    @property
    def field(self) -> str:
        """Field of the topic's message; `*` stands for each of the wires a, b (, c, d)."""
        if self.topic == "/joint_states":
            return "joints[].position"
        stem, unit = self.name.rsplit("_", 1)
        return f"{stem}_*_{unit}" if self.per_wire else self.name

    @property
    def column(self) -> str:
        """Name in tables: that of the quantity, but for the published `bend_deg` of the truth."""
        return "bend_deg" if self.name == "truth_deg" else self.name

    @property
    def unit(self) -> str:
        """Unit of the numbers, as it is written."""
        return UNITS[self.name.rpartition("_")[2]]


_FRICTION = "largest friction force of each element of the sheath on each wire, pulley to tip"
_SLACK = "how much longer each length of each wire is than its path, pulley to tip"
_TENSION = "tension in each length of each wire, pulley to tip"
_LATERAL = "angle of each sideways hinge, base to tip"
FEATURES = (
    Feature("pull_mm", "/command", "commanded pulling distance of wire a", lambda e: e.pull_mm),
    Feature(
        "lateral_pull_mm", "/command", "commanded pulling distance of wire c", lambda e: e.lateral_pull * 1e3
    ),
    Feature(
        "measured_deg",
        "/measurement",
        "bending angle of the tip as the sensor saw it",
        lambda e: e.measured_deg,
    ),
    Feature(
        "tension_n",
        "/tension",
        "tension of each wire at the pulley",
        lambda e: e.tension if e.wire_tension.shape[2] else np.empty(0),
        per_wire=True,
    ),
    Feature("truth_deg", "/truth", "true bending angle of the tip", lambda e: e.truth_deg),
    Feature(
        "lateral_bend_deg",
        "/truth",
        "true bending angle of the tip sideways",
        lambda e: np.degrees(e.lateral_bend),
    ),
    Feature("pulley_mm", "/truth", "distance that the pulley has really pulled", lambda e: e.pulley * 1e3),
    Feature(
        "sheath_bend_deg", "/truth", "angle that the sheath is bent by", lambda e: np.degrees(e.sheath_bend)
    ),
    Feature("wire_tension_n", "/truth", _TENSION, lambda e: e.wire_tension, per_wire=True),
    Feature("sheath_friction_n", "/truth", _FRICTION, lambda e: e.sheath_friction, per_wire=True),
    Feature("wire_slack_mm", "/truth", _SLACK, lambda e: e.wire_slack * 1e3, per_wire=True),
    Feature("joint_angle_rad", "/joint_states", "angle of each hinge, base to tip", lambda e: e.joint_angle),
    Feature("lateral_joint_angle_rad", "/joint_states", _LATERAL, lambda e: e.lateral_joint_angle),
)
"""Every quantity that an episode can hold: the one table of names, units, topics, fields and columns."""


def recorded(episode: Episode) -> dict[str, Array]:
    """Return the quantities that an episode holds, by the names of `FEATURES`."""
    values = {feature.name: np.asarray(feature.values(episode)) for feature in FEATURES}
    return {name: array for name, array in values.items() if array.size > 0}


def refuse_implausible(episode: Episode) -> None:
    """Refuse numbers beyond all endoscopes and sensors; the message names the first sample of a quantity."""
    for feature in FEATURES:
        with np.errstate(over="ignore"):
            values = np.asarray(feature.values(episode))
        largest = LARGEST.get(feature.name, LARGEST[feature.unit])
        wrong = np.abs(values) > largest * (1 + TOLERANCE)  # conversions of units round
        if wrong.any():
            place = tuple(np.argwhere(wrong)[0])
            rule = f"must be from {-largest:g} to {largest:g} {feature.unit}: is the unit right?"
            raise InputError(f"{feature.name} = {values[place]:g} at sample {place[0]}: {rule}")


def describe_features(episode: Episode) -> dict[str, dict[str, Any]]:
    """Return topic, field, unit, shape of a sample and meaning of what an episode holds, by name."""
    held = {name: array for name, array in recorded(episode).items() if not np.isnan(array).all()}
    described = {}
    for of in FEATURES:
        if of.name in held:
            facts = {"topic": of.topic, "field": of.field, "unit": of.unit}
            described[of.name] = facts | {"shape": list(held[of.name].shape[1:]), "meaning": of.meaning}
    return described


def statistics(episode: Episode) -> dict[str, dict[str, float]]:
    """Return count, least, largest, mean and standard deviation of each quantity, over all its numbers.

    NaN is not counted; a quantity that is NaN throughout is left out. Nine digits are kept: processors
    differ in how they round a sum.
    """
    figures = {}
    for name, array in sorted(recorded(episode).items()):
        known = array[~np.isnan(array)]
        if known.size > 0:
            found = {of: _rounded(getattr(known, of)()) for of in ("max", "mean", "min", "std")}
            figures[name] = {"count": int(known.size)} | found
    return figures


def wrong_statistics(episode: Episode, stated: Any) -> list[str]:
    """Return how the statistics of a record differ from stated ones, one line each."""
    found = statistics(episode)
    if not isinstance(stated, Mapping) or found.keys() != stated.keys():
        return ["statistics are of other quantities"]
    wrong = []
    for name, values in found.items():
        scale = max(abs(values["min"]), abs(values["max"]))
        for key, value in values.items():
            other = stated[name].get(key) if isinstance(stated[name], Mapping) else None
            close = isinstance(other, (int, float)) and abs(value - other) <= TOLERANCE * max(
                scale, abs(value)
            )
            if not close:
                wrong.append(f"{key} of {name} is {value:g}, not {other}")
    return wrong


def combine(parts: Iterable[Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Return the statistics of all records together, from those of each.

    Means and variances are merged pairwise (Chan, Golub and LeVeque 1979); nine digits are kept.
    """
    merged: dict[str, dict[str, float]] = {}
    for part in parts:
        for name, new in part.items():
            if name not in merged:
                merged[name] = dict(new)
                continue
            old = merged[name]
            count = old["count"] + new["count"]
            apart, share = new["mean"] - old["mean"], new["count"] / count
            squares = old["count"] * old["std"] ** 2 + new["count"] * new["std"] ** 2
            squares += apart**2 * old["count"] * share
            ends = {"min": min(old["min"], new["min"]), "max": max(old["max"], new["max"])}
            std = float(np.sqrt(squares / count))
            merged[name] = {"count": count, **ends, "mean": old["mean"] + apart * share, "std": std}
    return {
        name: {key: _rounded(value) if key != "count" else int(value) for key, value in values.items()}
        for name, values in merged.items()
    }


def _rounded(value: float) -> float:
    return float(f"{value:.9g}")


def column_names(feature: Feature, shape: Sequence[int]) -> tuple[str, ...]:
    """Return a name for each number that a quantity has in a sample of some shape, its unit last.

    Names are in the order of the flattened numbers: `bend_deg`; `joint_angle_0_rad` ... from the base on;
    `tension_a_n`, `tension_b_n`; `wire_tension_a_0_n`, `wire_tension_a_1_n` ... from the pulley on.
    """
    stem, unit = feature.column.rsplit("_", 1)
    axes = [[str(place) for place in range(size)] for size in shape]
    if "*" in feature.field:
        axes[0] = list(WIRES[: shape[0]])
    return tuple("_".join([stem, *places, unit]) for places in itertools.product(*axes))


def write_csv(path: str | Path, episode: Episode, *, everything: bool = False) -> Path:
    """Write an episode as a CSV table, one row per sample, in a file that appears when it is complete."""
    write_whole(path, csv_text(episode, everything=everything))
    return Path(path)


def csv_text(episode: Episode, *, everything: bool = False) -> str:
    """Return the table of an episode as CSV; each number has the digits that read back as the same double."""
    columns = table_columns(episode, everything=everything)
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def table_columns(episode: Episode, *, everything: bool = False) -> dict[str, Array]:
    """Return the columns (N,) of the table of an episode by name, one row per sample.

    The columns are `time_s`, those of the quantities of `TABLE` that are known, and, with `everything`, those
    of all others of `FEATURES`.
    """
    held = recorded(episode)
    known: dict[str, dict[str, Array]] = {}
    for feature in FEATURES:
        if (values := held.get(feature.name)) is not None:
            names = column_names(feature, values.shape[1:])
            known[feature.column] = dict(zip(names, values.reshape(len(values), -1).T, strict=True))
    preset = episode.metadata.get("preset")
    if isinstance(preset, Mapping) and "pulley_radius" in preset:
        angle = np.degrees(episode.pull / float(preset["pulley_radius"]))
        known[COMMAND_ANGLE] = {COMMAND_ANGLE: angle}
    chosen = [name for name in TABLE if name in known]
    if everything:
        chosen += [name for name in known if name not in TABLE]
    columns = {"time_s": episode.time}
    for name in chosen:
        columns |= known[name]
    return columns
