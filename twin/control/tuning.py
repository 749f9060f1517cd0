"""Tuning of controllers: the same number of settings is tried for each, on other twins than are scored.

Settings are points of a Sobol sequence (Sobol 1967) over all that a controller has, on logarithmic scales;
the last quarter of them are drawn about the best. The error is the geometric mean of those of all cases, so
that none outweighs the others, as the quickest reference would; of the settings within 5 % of the least the
one is taken that moves the command least. One search serves a sensor, on all strokes together.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gmean, qmc

from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec
from twin.control.trial import ControlCase, run_trial
from twin.errors import DivergedError

Array = NDArray[np.float64]
AROUND_THE_BEST = 0.25
"""Share of the settings that are drawn about the best of the others."""
ABOUT_AS_GOOD = 1.05
"""Error, in units of the least, within which the setting with the least travel is taken: travel is wear."""
NARROWER = 0.15
"""Half width of the range about the best, as a share of the whole."""


@dataclasses.dataclass(frozen=True)
class Tuned:
    """Result of a search.

    Attributes:
        settings: the best, by name.
        rmse_deg: its error, geometric mean of the cases of the tuning [deg].
        tried: how many settings were.
    """

    settings: dict[str, float]
    rmse_deg: float
    tried: int


def tune(
    spec: ControllerSpec, cases: Sequence[tuple[ControlKnowledge, ControlCase]], candidates: int, seed: int
) -> Tuned:
    """Search the settings of a controller."""
    names = list(spec.settings)
    if not names:
        return Tuned({}, _trials(spec, {}, cases)[0], 1)
    low, high = (
        np.log([getattr(setting, end) for setting in spec.settings.values()]) for end in ("low", "high")
    )
    late = math.ceil(AROUND_THE_BEST * candidates)
    early = max(candidates - late, 1)
    default = np.log([setting.default for setting in spec.settings.values()])
    tried = [default, *(low + point * (high - low) for point in _points(len(names), early - 1, seed))]
    found = [_trials(spec, _named(names, values), cases) for values in tried]
    best = tried[_best(found)]
    for point in _points(len(names), candidates - early, seed + 1):
        about = np.clip(best + (2 * point - 1) * NARROWER * (high - low), low, high)
        tried.append(about)
        found.append(_trials(spec, _named(names, about), cases))
    least = _best(found)
    return Tuned(_named(names, tried[least]), found[least][0], len(tried))


def _best(found: Sequence[tuple[float, float]]) -> int:
    """Return the place of the least travel among those with about the least error."""
    error, travel = np.array(found).T
    return int(np.argmin(np.where(error <= ABOUT_AS_GOOD * error.min(), travel, np.inf)))


def _points(dimensions: int, count: int, seed: int) -> Array:
    if count < 1:
        return np.empty((0, dimensions))
    sequence = qmc.Sobol(dimensions, seed=seed)
    points: Array = sequence.random_base2(math.ceil(math.log2(count)) if count > 1 else 0)[:count]
    return points


def _named(names: Sequence[str], logarithms: Array) -> dict[str, float]:
    return dict(zip(names, np.exp(logarithms).tolist(), strict=True))


def _trials(
    spec: ControllerSpec, settings: Mapping[str, float], cases: Sequence[tuple[ControlKnowledge, ControlCase]]
) -> tuple[float, float]:
    """Return the geometric mean of the errors [deg] and the travel [mm] of all trials of a setting."""
    errors, travel = [], 0.0
    for knowledge, case in cases:
        told = dataclasses.replace(knowledge, settings={**knowledge.settings, spec.name: settings})
        try:
            trial = run_trial(spec.name, told, case)
        except DivergedError:
            return math.inf, math.inf
        errors.append(trial.rmse_deg)
        travel += trial.travel_mm
    return float(gmean(errors)), travel
