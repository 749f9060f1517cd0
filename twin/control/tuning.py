"""Tuning of controllers: the same number of settings is tried for each, on other twins than are scored.

Settings are points of a Sobol sequence (Sobol 1967) over all that a controller has, on logarithmic scales;
the last quarter of them are drawn about the best. The error is the root mean square over all cases. One
search serves a sensor, on all strokes together.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec
from twin.control.trial import ControlCase, run_trial
from twin.errors import DivergedError

Array = NDArray[np.float64]
AROUND_THE_BEST = 0.25
"""Share of the settings that are drawn about the best of the others."""
NARROWER = 0.15
"""Half width of the range about the best, as a share of the whole."""


@dataclasses.dataclass(frozen=True)
class Tuned:
    """Result of a search.

    Attributes:
        settings: the best, by name.
        rmse_deg: its error on the cases of the tuning [deg].
        tried: how many settings were.
    """

    settings: dict[str, float]
    rmse_deg: float
    tried: int


def tune(
    spec: ControllerSpec, cases: Sequence[tuple[ControlKnowledge, ControlCase]], candidates: int, seed: int
) -> Tuned:
    """Search the settings of a controller.

    Args:
        spec: the controller.
        cases: knowledge and case of each trial of a setting.
        candidates: settings to try; a controller that has none is tried once.
        seed: of the search.
    """
    names = list(spec.settings)
    if not names:
        return Tuned({}, _error(spec, {}, cases), 1)
    low, high = (
        np.log([getattr(setting, end) for setting in spec.settings.values()]) for end in ("low", "high")
    )
    late = math.ceil(AROUND_THE_BEST * candidates)
    early = max(candidates - late, 1)
    default = np.log([setting.default for setting in spec.settings.values()])
    tried = [default, *(low + point * (high - low) for point in _points(len(names), early - 1, seed))]
    errors = [_error(spec, _named(names, values), cases) for values in tried]
    best = tried[int(np.argmin(errors))]
    for point in _points(len(names), candidates - early, seed + 1):
        about = np.clip(best + (2 * point - 1) * NARROWER * (high - low), low, high)
        tried.append(about)
        errors.append(_error(spec, _named(names, about), cases))
    least = int(np.argmin(errors))
    return Tuned(_named(names, tried[least]), errors[least], len(tried))


def _points(dimensions: int, count: int, seed: int) -> Array:
    if count < 1:
        return np.empty((0, dimensions))
    sequence = qmc.Sobol(dimensions, seed=seed)
    points: Array = sequence.random_base2(math.ceil(math.log2(count)) if count > 1 else 0)[:count]
    return points


def _named(names: Sequence[str], logarithms: Array) -> dict[str, float]:
    return dict(zip(names, np.exp(logarithms).tolist(), strict=True))


def _error(
    spec: ControllerSpec, settings: Mapping[str, float], cases: Sequence[tuple[ControlKnowledge, ControlCase]]
) -> float:
    squares = []
    for knowledge, case in cases:
        told = dataclasses.replace(knowledge, settings={**knowledge.settings, spec.name: settings})
        try:
            squares.append(run_trial(spec.name, told, case).rmse_deg ** 2)
        except DivergedError:
            return math.inf
    return float(np.sqrt(np.mean(squares)))
