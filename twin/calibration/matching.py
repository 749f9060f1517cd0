"""Match of a preset to an instrument that is only published, by least squares.

A Coleman-Hodgdon model and errors of a filter are fewer numbers than the preset has parameters: each has a
prior.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.calibration.circle import out_of_round
from twin.calibration.priors import Prior, decode, encode
from twin.calibration.published import Commands, Outcome, Published, outcomes
from twin.preset.preset import Preset

Array = NDArray[np.float64]

STEP = 0.02  # of differences
# What one unit of a residual is.
MODEL, ROW, MISFIT, PRIOR = 0.005, 0.01, 0.02, 2.0  # relative, relative, [deg], standard deviations
ROUND = 1.5e-3  # share of the radius
INSIDE = 0.95  # of what a row may be off by: beyond, it counts by `ROW`


def match(
    base: Preset,
    priors: Mapping[str, Prior],
    published: Published,
    commands: Commands,
    *,
    radii: Sequence[float] = (),
    start: Array | None = None,
    steps: int = 20,
    on_outcome: Callable[[Preset, Outcome, float], None] | None = None,
) -> tuple[Preset, Outcome, float]:
    """Fit a preset to what is published, by least squares from one start.

    Args:
        base: preset with every other parameter.
        priors: of the fitted parameters, by name.
        published: what is known.
        commands: the excitation.
        radii: of the circles of commands that the tip shall follow round, by `published.round_within` [m].
        start: (P,) distances from the priors' centres [standard deviations]; those of `base` if not given.
        steps: most steps.
        on_outcome: called with each endoscope that is better than the last, its outcome and its cost.

    Returns:
        The preset, its outcome, and the sum of squares.
    """
    noises = list(published.active)
    lowest = np.inf

    def evaluate(points: Sequence[Array]) -> list[Array]:
        nonlocal lowest
        presets = [decode(base, priors, point) for point in points]
        results = []
        reached = outcomes(presets, commands, noises)
        oval = out_of_round(presets, radii) if radii else np.empty((len(presets), 0))
        for preset, point, outcome, of_round in zip(presets, points, reached, oval, strict=True):
            passed = np.clip(of_round - published.round_within, 0, 1) / ROUND
            results.append(np.concatenate([_residual(outcome, published, point), passed]))
            cost = float(results[-1] @ results[-1])
            if outcome is not None and cost < lowest:
                lowest = cost
                if on_outcome:
                    on_outcome(preset, outcome, cost)
        return results

    def jacobian(point: Array) -> Array:
        here, *there = evaluate([point, *(point + STEP * np.eye(len(point)))])
        return (np.array(there) - here).T / STEP

    point = encode(base, priors) if start is None else start
    bounds = np.array([prior.bounds for prior in priors.values()]).T
    margin = 1e-3
    found = least_squares(
        lambda at: evaluate([at])[0],
        np.clip(point, bounds[0] + margin, bounds[1] - margin),
        jac=jacobian,
        bounds=bounds,
        max_nfev=steps,
        xtol=1e-3,
        ftol=1e-3,
    )
    preset = decode(base, priors, found.x)
    outcome = outcomes([preset], commands, noises)[0]
    if outcome is None:
        raise FloatingPointError(f"{base.name!r} has no equilibrium with these parameters")
    return preset, outcome, 2 * float(found.cost)


def _residual(outcome: Outcome | None, published: Published, point: Array) -> Array:
    """Return what an endoscope is off by: equalities as they are, limits where they are passed."""
    rows, allowed = np.array(list(published.active.values())).T
    if outcome is None:
        return np.full(3 + 3 * len(rows) + 4 + len(point), 30.0)
    model = np.log(outcome.model / published.model)
    model = (np.median(model, axis=0) + model.mean(axis=0)) / 2  # the median alone has corners
    active = np.log(outcome.active.mean(axis=0) / rows)
    low, high = np.log1p(-INSIDE * allowed), np.log1p(INSIDE * allowed)
    return np.concatenate(
        [
            model / MODEL,
            active / allowed,
            np.maximum(low - active, 0) / ROW,
            np.maximum(active - high, 0) / ROW,
            [
                max(published.static[0] - outcome.static.mean(), 0.0) / MISFIT,
                max(outcome.static.mean() - published.static[1], 0.0) / MISFIT,
                max(outcome.misfit.mean() - published.misfit, 0.0) / MISFIT,
                max(outcome.steady.mean() - published.steady, 0.0) / MISFIT,
            ],
            point / PRIOR,
        ]
    )
