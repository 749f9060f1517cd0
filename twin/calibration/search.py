"""Fit of a preset to logs: many starts of least squares on the reduced twin, then the twin in MuJoCo."""

import dataclasses
import functools
import threading
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.calibration.confirm import confirmed
from twin.calibration.descent import descend, over_what_is_told
from twin.calibration.fit import Fit
from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import PRIOR, penalised, prior_weight, residuals
from twin.calibration.parameters import FreeParameters
from twin.calibration.stages import OnProgress, Stages
from twin.calibration.walk import FARTHEST, STRIDES, parameter_along, walk
from twin.calibration.weights import weighed
from twin.errors import InputError
from twin.files.bounds import check_between
from twin.files.state_file import state_key
from twin.physics import MUJOCO

Array = NDArray[np.float64]

SCREENED = 40
"""Candidates that are tried for each start of least squares."""
STARTS = 8
"""Starts of least squares: valleys are many, and the best one by the fitted samples is taken."""
FINISHED = 2
"""The best starts that are followed to the bottom."""
LOWER = 0.9999
"""Share of the cost below which another valley is lower."""
TURNS = 3
"""Most times that the first guess is given less weight, where the logs leave little unexplained."""
SPREAD = 0.6  # of the candidates about the first guess: a factor of 1.8 on the scale of the search
WALK = 4  # stages of a walk: to the bottom, to either side, and to where it lands
STEPS, MOST_STEPS = 12, 60  # of a start, and of one that is finished
USUAL_STEPS, USUAL_WALK, TRIALS = 15, 6, 8  # of one finished, of a walk to a side; simulations that are timed
MOST_STARTS = 1000
MOST_SEED = 2**32 - 1


def calibrate(
    structures: Sequence[FreeParameters],
    loops: Sequence[MeasuredLoop],
    *,
    seed: int,
    starts: int = STARTS,
    state_file: Path | None = None,
    on_progress: OnProgress | None = None,
) -> Fit:
    """Fit a preset to logs.

    On the reduced twin: random candidates about the first guess are tried, least squares in a trust region
    (SciPy's `trf`) goes down from the best, and to the bottom from the best of these. Walks along its valley
    then look for a lower one. `confirmed` moves the fit to where the twin in MuJoCo agrees with the logs.

    Args:
        structures: the fitted parameters and their first guess; of several sets the one that fits best is
            taken, each with a share of the starts.
        loops: the logs.
        seed: of the candidates.
        starts: of least squares.
        state_file: where what is found is kept; an interrupted calibration goes on there.
        on_progress: called with the stages done, their total, and the lowest cost so far.

    Returns:
        The fit.

    Raises:
        ValueError: there is no log, `starts` or `seed` is out of range, gravity pulls at the endoscope, or
            the state file is foreign or damaged.
        FloatingPointError: the best fit cannot be simulated in MuJoCo.
    """
    if not loops:
        raise InputError("no log to calibrate on")
    check_effort(starts, seed)
    count = len(structures) + starts + min(FINISHED, starts) + TURNS + WALK * len(STRIDES) + 1
    key = _key(structures, loops, seed, starts) if state_file else ""
    stages = Stages(count, state_file, key, on_progress)
    search = _Search(structures, loops, starts, stages)
    begun = search.screen(np.random.default_rng(seed))
    down = search.descend("start", begun, STEPS, smooth=False)
    best = sorted(down, key=lambda one: one[0])[:FINISHED]
    finished = search.descend("finish", [(which, x) for _, which, x in best], MOST_STEPS)
    cost, which, numbers = min(finished, key=lambda one: one[0])
    free, weight = structures[which], PRIOR
    for turn in range(TURNS):
        left = float((residuals([free.decode(numbers)], loops, "reduced") ** 2).sum())
        if prior_weight(left) < 0.8 * weight:
            weight = prior_weight(left)
            cost, _, numbers = search.descend(f"turn {turn}", [(which, numbers)], MOST_STEPS, weight)[0]
        else:
            stages.tell(cost)
    if weight < PRIOR:
        for number in range(len(STRIDES)):
            search.weigh(free, numbers)
            cost, numbers = search.walk(number, which, numbers, weight)
    else:  # what the twin cannot explain outweighs what neighbouring valleys differ by
        stages.skip(WALK * len(STRIDES), cost)
    fit = confirmed(
        free,
        search.loops,
        numbers,
        weight,
        jacobian=lambda at, around: over_what_is_told(free, search.loops, at, weight, around),
        counted=loops,
    )
    stages.tell(cost)
    return dataclasses.replace(fit, beside=search.beside(which, numbers, weight))


def check_effort(starts: int, seed: int) -> None:
    """Refuse a number of starts or a seed that cannot be.

    Raises:
        ValueError: so it is.
    """
    check_between("starts", starts, 1, MOST_STARTS)
    check_between("seed", seed, 0, MOST_SEED)


def foreseen_seconds(
    structures: Sequence[FreeParameters], loops: Sequence[MeasuredLoop], starts: int
) -> float:
    """Return about how long a search takes on this machine [s], from the time of a few simulations."""
    free = structures[0]
    residuals([free.base], loops, "reduced")  # what is compiled or loaded first is no part of it
    begun = time.perf_counter()
    residuals([free.base] * TRIALS, loops, "reduced")
    each = (time.perf_counter() - begun) / TRIALS
    step = len(free.names) + 2
    descents = STEPS * step * starts + USUAL_STEPS * 2 * step * min(FINISHED, starts)
    walks = len(STRIDES) * (2 * USUAL_WALK * STEPS * step + USUAL_STEPS * 2 * step)
    return each * (SCREENED * starts + descents + walks)


class _Search:
    """Search of one calibration: its logs as they are weighed, and the points that its walks met."""

    def __init__(
        self,
        structures: Sequence[FreeParameters],
        loops: Sequence[MeasuredLoop],
        starts: int,
        stages: Stages,
    ) -> None:
        self._structures, self._starts, self._stages = structures, starts, stages
        self.loops = self._given = list(loops)
        self._met: list[Array] = []

    def screen(self, rng: np.random.Generator) -> list[tuple[int, Array]]:
        """Return the best of random candidates: which structure, and where."""
        begun: list[tuple[int, Array]] = []
        for which, free in enumerate(self._structures):
            share = len(range(which, self._starts, len(self._structures)))
            drawn = rng.normal(size=(max(share * SCREENED, 1), len(free.names)))
            drawn[0] = 0.0
            candidates = np.clip(free.start + SPREAD * drawn, free.lower, free.upper)
            cost = self._stages.once(
                f"screen {which}", (len(candidates),), functools.partial(self._costs, free, candidates)
            )
            begun += [(which, candidates[place]) for place in np.argsort(cost, kind="stable")[:share]]
            self._stages.tell(float(cost.min()))
        return begun

    def descend(
        self,
        stage: str,
        begun: Sequence[tuple[int, Array]],
        steps: int,
        weight: float = PRIOR,
        *,
        smooth: bool = True,
    ) -> list[tuple[float, int, Array]]:
        """Return the cost, structure and place that least squares reaches from each start."""

        def reach(number: int, stopped: threading.Event) -> tuple[float, int, Array]:
            which, start = begun[number]
            found = self._stages.once(
                f"{stage} {number}",
                (len(start) + 1,),
                lambda: descend(
                    self._structures[which],
                    self.loops,
                    start,
                    steps,
                    weight,
                    smooth=smooth,
                    threads=1 if len(begun) > 1 else 0,
                    stopped=stopped,
                ),
            )
            return float(found[0]), which, found[1:]

        return self._stages.side_by_side(reach, range(len(begun)), lambda reached: reached[0])

    def weigh(self, free: FreeParameters, numbers: Array) -> None:
        """Weigh the channels of the logs by what a point leaves of each."""
        self.loops = weighed(self._given, residuals([free.decode(numbers)], self._given, "reduced")[0])

    def walk(self, number: int, which: int, numbers: Array, weight: float) -> tuple[float, Array]:
        """Return the cost and place of the lowest valley that a walk to both sides finds, or of this one."""
        free = self._structures[which]
        name = parameter_along(free)
        ((cost, _, numbers),) = self.descend(f"bottom {number}", [(which, numbers)], MOST_STEPS, weight)
        if name is None:
            self._stages.skip(WALK - 1, cost)
            return cost, numbers

        def side(stride: float, stopped: threading.Event) -> Array:
            return self._stages.once(
                f"walk {number} {stride:+g}",
                (FARTHEST, len(numbers) + 1),
                lambda: walk(
                    free, self.loops, cost, numbers, name, stride, STEPS, weight, threads=1, stopped=stopped
                ),
            )

        strides = (-STRIDES[number], STRIDES[number])
        met = np.concatenate(
            self._stages.side_by_side(side, strides, lambda points: float(points[:, 0].min()))
        )
        self._met.append(met[:, 1:])
        lowest = met[met[:, 0].argmin(), 1:]
        ((reached, _, end),) = self.descend(f"landing {number}", [(which, lowest)], MOST_STEPS, weight)
        return (reached, end) if reached < LOWER * cost else (cost, numbers)

    def beside(self, which: int, numbers: Array, weight: float) -> Array:
        """Return the points that walks met, of each shortest stride the lowest, as `Fit.beside` has them."""
        free = self._structures[which]
        name = parameter_along(free)
        if not self._met or name is None:
            return np.empty((0, 1 + len(numbers)))
        away = np.unique(np.concatenate(self._met), axis=0) - numbers
        here, *others = self._costs(free, np.vstack([numbers, numbers + away]), weight)
        lowest_first = np.argsort(others, kind="stable")
        along = away[lowest_first, free.names.index(name)]
        _, chosen = np.unique(np.round(along / min(STRIDES)), return_index=True)
        chosen = lowest_first[chosen]
        return np.column_stack([np.array(others)[chosen] - here, away[chosen]])

    def _costs(self, free: FreeParameters, candidates: Array, weight: float = PRIOR) -> Array:
        off = penalised(free, list(candidates), self.loops, "reduced", weight)
        cost: Array = (off**2).sum(axis=1)
        return cost


def _key(structures: Sequence[FreeParameters], loops: Sequence[MeasuredLoop], seed: int, starts: int) -> str:
    """Return the SHA-256 of all that a search depends on: a saved state is resumed only if it is the same."""
    versions = [__version__, MUJOCO, *(version(name) for name in ("numpy", "scipy"))]
    inputs: list[Any] = [versions, seed, starts]
    for free in structures:
        inputs += [free.base.to_dict(), list(free.names)]
    for loop in loops:
        inputs += [loop.name, loop.sample_time, loop.sheath_bend, loop.offset, loop.origin]
        inputs += [loop.pull, loop.bend, loop.tension, loop.fitted, loop.lateral_pull, loop.lateral_bend]
        inputs.append(loop.scales)
    return state_key(*inputs)
