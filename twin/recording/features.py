"""Quantities of an episode: the table of their names, units, topics and meanings, and their statistics."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode

Array = NDArray[np.float64]


TOLERANCE = 1e-7
"""Relative, of statistics: nine digits of them are written."""


UNITS = {"mm": "mm", "deg": "deg", "rad": "rad", "n": "N"}
"""Unit of a quantity, by what its name ends in."""


@dataclasses.dataclass(frozen=True)
class Feature:
    """One quantity of an episode.

    Attributes:
        name: its name, which ends in its unit.
        topic: topic of its messages.
        field: field of the topic's message; `*` stands for each of the wires a, b (, c, d).
        meaning: what it is, in words that the Protobuf comments and docs/dataset.md begin with.
        values: (N, ...) its numbers of an episode, in its unit; empty where it was not recorded.
    """

    name: str
    topic: str
    field: str
    meaning: str
    values: Callable[[Episode], Array]

    @property
    def column(self) -> str:
        """Name in tables: that of the quantity, but for the published `bend_deg` of the truth."""
        return "bend_deg" if self.name == "truth_deg" else self.name

    @property
    def unit(self) -> str:
        """Unit of the numbers, as it is written."""
        return UNITS[self.name.rpartition("_")[2]]


FEATURES = (
    Feature("pull_mm", "/command", "pull_mm", "commanded pulling distance of wire a", lambda e: e.pull_mm),
    Feature(
        "lateral_pull_mm",
        "/command",
        "lateral_pull_mm",
        "commanded pulling distance of wire c",
        lambda e: e.lateral_pull * 1e3,
    ),
    Feature(
        "measured_deg",
        "/measurement",
        "measured_deg",
        "bending angle of the tip as the sensor saw it",
        lambda e: e.measured_deg,
    ),
    Feature(
        "tension_n",
        "/tension",
        "tension_*_n",
        "tension of each wire at the pulley",
        lambda e: e.tension if e.wire_tension.shape[2] else np.empty(0),
    ),
    Feature("truth_deg", "/truth", "truth_deg", "true bending angle of the tip", lambda e: e.truth_deg),
    Feature(
        "lateral_bend_deg",
        "/truth",
        "lateral_bend_deg",
        "true bending angle of the tip sideways",
        lambda e: np.degrees(e.lateral_bend),
    ),
    Feature(
        "pulley_mm",
        "/truth",
        "pulley_mm",
        "distance that the pulley has really pulled",
        lambda e: e.pulley * 1e3,
    ),
    Feature(
        "sheath_bend_deg",
        "/truth",
        "sheath_bend_deg",
        "angle that the sheath is bent by",
        lambda e: np.degrees(e.sheath_bend),
    ),
    Feature(
        "wire_tension_n",
        "/truth",
        "wire_tension_*_n",
        "tension in each length of each wire, pulley to tip",
        lambda e: e.wire_tension,
    ),
    Feature(
        "sheath_friction_n",
        "/truth",
        "sheath_friction_*_n",
        "largest friction force of each element of the sheath on each wire, pulley to tip",
        lambda e: e.sheath_friction,
    ),
    Feature(
        "wire_slack_mm",
        "/truth",
        "wire_slack_*_mm",
        "how much longer each length of each wire is than its way, pulley to tip",
        lambda e: e.wire_slack * 1e3,
    ),
    Feature(
        "joint_angle_rad",
        "/joint_states",
        "joints[].position",
        "angle of each hinge, base to tip",
        lambda e: e.joint_angle,
    ),
    Feature(
        "lateral_joint_angle_rad",
        "/joint_states",
        "joints[].position",
        "angle of each sideways hinge, base to tip",
        lambda e: e.lateral_joint_angle,
    ),
)
"""Every quantity that an episode can hold: the one table of names, units, topics, fields and columns."""


def recorded(episode: Episode) -> dict[str, Array]:
    """Return the quantities that an episode holds, by the names of `FEATURES`."""
    values = {feature.name: np.asarray(feature.values(episode)) for feature in FEATURES}
    return {name: array for name, array in values.items() if array.size > 0}


def describe_features(episode: Episode) -> dict[str, dict[str, Any]]:
    """Return topic, field, unit, shape of a sample and meaning of what an episode holds, by name.

    A quantity of which every number is missing (NaN) is left out, as in the statistics.
    """
    held = {name: array for name, array in recorded(episode).items() if not np.isnan(array).all()}
    return {
        feature.name: {
            "topic": feature.topic,
            "field": feature.field,
            "unit": feature.unit,
            "shape": list(held[feature.name].shape[1:]),
            "meaning": feature.meaning,
        }
        for feature in FEATURES
        if feature.name in held
    }


def statistics(episode: Episode) -> dict[str, dict[str, float]]:
    """Return count, least, largest, mean and standard deviation of each quantity, over all its numbers.

    A measurement that is missing (NaN) is not counted; a quantity of which all are is left out. Nine digits
    are kept: processors differ in how they round a sum. The order is that of the alphabet, as in the metadata
    of a file.
    """
    figures = {}
    for name, array in sorted(recorded(episode).items()):
        known = array[~np.isnan(array)]
        if known.size == 0:
            continue
        figures[name] = {
            "count": int(known.size),
            "max": _rounded(known.max()),
            "mean": _rounded(known.mean()),
            "min": _rounded(known.min()),
            "std": _rounded(known.std()),
        }
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

    Means and variances are merged pairwise (Chan, Golub and LeVeque 1979), which loses little to rounding
    where the mean is large beside the deviation; nine digits of the result are kept.
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
            merged[name] = {
                "count": count,
                "min": min(old["min"], new["min"]),
                "max": max(old["max"], new["max"]),
                "mean": old["mean"] + apart * share,
                "std": float(np.sqrt(squares / count)),
            }
    return {
        name: {key: _rounded(value) if key != "count" else int(value) for key, value in values.items()}
        for name, values in merged.items()
    }


def _rounded(value: float) -> float:
    return float(f"{value:.9g}")
