"""`python -m scripts.studies.match_paper`: fit the preset of the ureteroscope to the paper's tables.

A Coleman-Hodgdon model and errors of a filter are fewer numbers than the preset has parameters: each has a
prior of what such parts can be.
"""

import dataclasses
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from scripts.command import Options, Summary, complain, run_verb
from scripts.studies.published import Commands, Outcome, Published, out_of_round, outcomes
from twin.estimation.active_model import METHOD
from twin.evaluation.paper import paper_value
from twin.evaluation.protocol import PAPER_CONDITIONS
from twin.files.bounds import check_between
from twin.preset.file import load_preset
from twin.preset.preset import Preset

Array = NDArray[np.float64]

MODEL = (1.15, 22.38, 5.0)  # the paper's a [1/mm], b [deg/mm] and c [deg/mm]
STROKES = ((2e-3, 4e-3), (-1e-3, 1e-3))  # of identification and test [m]
SECONDS = 60.0
WITHIN = 0.15  # of the paper's RMSE of the active model
ROUGHLY = 0.5  # under two noises, at which the paper's AM is far better or worse than any of its model can be
ROUGH = {("gaussian", 5.0), ("poisson", 0.1)}
STATIC = (3.9, 5.3)  # RMSE of C-H, wrong start included, under the noises that it cannot depend on [deg]
MISFIT, STEADY = 1.15, 1.5  # [deg]
RADII, ROUND_WITHIN = (1e-3, 1.5e-3, 3e-3), 0.0275  # [m], of the radius

STEP = 0.02  # of differences
# What one unit of a residual is.
MODEL_UNIT, ROW, MISFIT_UNIT, PRIOR = 0.005, 0.01, 0.02, 2.0  # relative, relative, [deg], deviations
ROUND = 1.5e-3  # share of the radius
INSIDE = 0.95  # of what a row may be off by: beyond, it counts by `ROW`


@dataclasses.dataclass(frozen=True)
class Prior:
    """Prior of one parameter. Distances from its centre are by its logarithm, unless it may be 0."""

    centre: float  # usual value
    deviation: float  # standard deviation, of the logarithm or of the value
    limits: tuple[float, float]  # lowest and highest plausible value

    def distance(self, value: float) -> float:
        """Return how far a value is from the centre [standard deviations]."""
        if self.limits[0] > 0:
            return float(np.log(value / self.centre)) / self.deviation
        return (value - self.centre) / self.deviation

    def value(self, distance: float) -> float:
        """Return the value at a distance from the centre, within the limits."""
        if self.limits[0] > 0:
            value = self.centre * float(np.exp(distance * self.deviation))
        else:
            value = self.centre + distance * self.deviation
        return float(np.clip(value, *self.limits))


def encode(preset: Preset, priors: Mapping[str, Prior]) -> Array:
    """Return the distances (P,) of a preset's parameters from the centres [standard deviations]."""
    values = (np.clip(getattr(preset, name), *prior.limits) for name, prior in priors.items())
    return np.array([p.distance(float(v)) for p, v in zip(priors.values(), values, strict=True)])


def decode(base: Preset, priors: Mapping[str, Prior], distances: Array) -> Preset:
    """Return the preset at distances (P,) from the centres."""
    values = zip(priors.items(), distances, strict=True)
    return base.replace(**{name: prior.value(distance) for (name, prior), distance in values})


URETEROSCOPE = {
    # Shape-memory section of 40 mm: 10 to 80 N mm / rad, some stiffer where it is bent far.
    "section_stiffness": Prior(0.024, 0.5, (8e-3, 0.08)),
    "section_stiffening": Prior(0.03, 1.0, (2e-3, 0.5)),
    # Pins of hinges that carry the wires' force, and more at the base, which carries all of the section.
    "joint_friction": Prior(8e-4, 0.8, (5e-5, 4e-3)),
    "joint_friction_taper": Prior(0.5, 0.25, (0.0, 0.8)),
    "routing_friction": Prior(0.15, 0.6, (5e-3, 0.4)),  # steel on steel, oiled to dry
    # Wires at the wall of an instrument of 7.5 to 9.5 Fr, 2.5 to 3.2 mm across.
    "wire_offset": Prior(1.1e-3, 0.15, (0.9e-3, 1.4e-3)),
    # A strand of 0.2 to 0.3 mm and 0.7 m, with what yields at its ends; it stiffens as it is laid straight.
    "wire_stiffness": Prior(8e3, 0.5, (3e3, 2e4)),
    # Those of ViO-Com, which are measured, stiffen by 0.2.
    "wire_stiffening": Prior(0.12, 0.7, (2e-3, 0.4)),
    "pretension": Prior(8.0, 0.3, (3.0, 14.0)),  # more than friction takes, or nothing is left at the tip
    # A lined sheath: PTFE against steel, and wires pressed to its wall by their own stiffness.
    "sheath_friction": Prior(0.04, 0.5, (5e-3, 0.12)),
    "sheath_friction_floor": Prior(0.4, 0.6, (0.05, 2.0)),
    "sheath_friction_growth": Prior(1.0, 0.6, (0.1, 4.0)),
}
"""The paper's ureteroscope, by the parts of such instruments."""


def match(
    base: Preset,
    priors: Mapping[str, Prior],
    published: Published,
    commands: Commands,
    *,
    radii: Sequence[float] = (),
    start: Array | None = None,
    steps: int = 20,
    on_outcome: Callable[[Preset, Outcome, float], None] = lambda *_: None,
) -> tuple[Preset, Outcome, float]:
    """Return the preset that fits what is published, by least squares from one start, its outcome and cost.

    The tip shall follow circles of commands of these radii [m] round, by `published.round_within`. `start`
    (P,) are distances from the priors' centres [standard deviations], those of `base` if not given;
    `on_outcome` is called with each endoscope that is better than the last.
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
                on_outcome(preset, outcome, cost)
        return results

    def jacobian(point: Array) -> Array:
        here, *there = evaluate([point, *(point + STEP * np.eye(len(point)))])
        return (np.array(there) - here).T / STEP

    point = encode(base, priors) if start is None else start
    bounds = np.array([[p.distance(limit) for limit in p.limits] for p in priors.values()]).T
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
    static = outcome.static.mean()
    beyond = [
        published.static[0] - static,
        static - published.static[1],
        outcome.misfit.mean() - published.misfit,
        outcome.steady.mean() - published.steady,
    ]
    return np.concatenate(
        [
            model / MODEL_UNIT,
            active / allowed,
            np.maximum(low - active, 0) / ROW,
            np.maximum(active - high, 0) / ROW,
            np.maximum(beyond, 0) / MISFIT_UNIT,
            point / PRIOR,
        ]
    )


@dataclasses.dataclass(frozen=True)
class MatchPaper(Options):
    """Fit a preset such that C-H and the active model have the paper's parameters and errors in it."""

    preset: str = "ureteroscope"
    """Preset to start from, and with every other parameter."""
    seeds: int = 10
    """Draws of the excitation, from 11 on: the first ten are left for a check."""
    episodes: tuple[int, int] = (4, 5)
    """Of each, as in `endotwin generate`: for the identification and for the test."""
    starts: int = 1
    """Starts of least squares: the preset itself, then draws from the priors."""
    steps: int = 20
    """Most steps from each."""
    seed: int = 0
    """Of the starts."""


def match_paper(args: MatchPaper) -> Summary:
    """Print the fitted parameters."""
    for name in ("seeds", "starts", "steps"):
        check_between(name, getattr(args, name), 1, 1000)
    active = {}
    for kind, level in PAPER_CONDITIONS:
        value = paper_value(kind, level, METHOD, "rmse_deg")
        assert value is not None
        active[kind, level] = (value, ROUGHLY if (kind, level) in ROUGH else WITHIN)
    published = Published(MODEL, active, STATIC, MISFIT, STEADY, ROUND_WITHIN)
    base = load_preset(args.preset)
    seeds = range(11, 11 + args.seeds)
    commands = Commands.drawn(seeds, strokes=STROKES, episodes=args.episodes, seconds=SECONDS)
    rng = np.random.default_rng(args.seed)
    found = []
    for number in range(args.starts):
        complain(f"start {number + 1} of {args.starts}")
        start = rng.normal(size=len(URETEROSCOPE)) if number else None
        given = base, URETEROSCOPE, published, commands
        found.append(match(*given, radii=RADII, start=start, steps=args.steps, on_outcome=_show))
    preset, outcome, cost = min(found, key=lambda one: one[2])
    _show(preset, outcome, cost)
    values = {name: float(f"{getattr(preset, name):.4g}") for name in URETEROSCOPE}
    return Summary("\n".join(f"{name}: {value}" for name, value in values.items()), values)


def _show(preset: Preset, outcome: Outcome, cost: float) -> None:
    a, b, c = np.median(outcome.model, axis=0)
    rows = ", ".join(f"{row:.2f}" for row in outcome.active.mean(axis=0))
    complain(
        f"cost {cost:.1f}: a = {a:.3f}, b = {b:.2f}, c = {c:.2f}, misfit {outcome.misfit.mean():.2f} deg, "
        f"C-H {outcome.static.mean():.2f} ({outcome.steady.mean():.2f} after the start), AM {rows} deg"
    )


main = partial(run_verb, MatchPaper, match_paper)

if __name__ == "__main__":
    sys.exit(main())
