"""Fit of a preset to logs: many starts of least squares on the reduced twin, then the twin in MuJoCo."""

import dataclasses
import functools
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.calibration.descent import (
    FARTHEST,
    STRIDES,
    Valley,
    descend,
    parameter_along,
    smoothed_jacobian,
    walk,
)
from twin.calibration.logs import MeasuredLoop
from twin.calibration.objective import (
    PRIOR,
    own_offsets,
    penalised,
    predict,
    prior_weight,
    residuals,
    weighed,
)
from twin.calibration.parameters import DEFAULT, SIGNED, SPARED, FreeParameters
from twin.errors import DivergedError, InputError
from twin.files.bounds import check_between
from twin.files.state_file import damaged_state, read_state, state_key, write_state
from twin.physics import MUJOCO
from twin.preset.preset import Preset

Array = NDArray[np.float64]
T = TypeVar("T")
R = TypeVar("R")
OnProgress = Callable[[int, int, float], None]
"""Called with the stages done, their total, and the lowest cost so far."""

STATE = "calibration state"  # kind of the state that an interrupted calibration leaves


class Stages:
    """Stages of one calibration."""

    def __init__(self, total: int, state_file: Path | None, key: str, on_progress: OnProgress | None) -> None:
        """Resume the state of an interrupted calibration with the same key."""
        self._kept = (read_state(state_file, STATE, key) if state_file else None) or {}
        self._state_file, self._key, self._on_progress = state_file, key, on_progress
        self._total, self._done = total, 0
        self._lowest, self._lock = np.inf, threading.Lock()

    def finish(self, cost: float, stages: int = 1) -> None:
        """Report that stages are done, or not needed."""
        for _ in range(stages):
            self._done += 1
            self._lowest = min(self._lowest, cost)
            if self._on_progress:
                self._on_progress(self._done, self._total, self._lowest)

    def once(self, name: str, shape: tuple[int, ...], work: Callable[[], Array]) -> Array:
        """Return the stored result of a stage, or compute and store it."""
        if (found := self._kept.get(name)) is not None:
            if self._state_file and found.shape != shape:
                raise damaged_state(self._state_file, STATE)
            return found
        found = work()
        with self._lock:
            self._kept[name] = found
            if self._state_file is not None:
                write_state(self._state_file, STATE, self._key, self._kept)
        return found

    def side_by_side(
        self, work: Callable[[T, threading.Event], R], items: Sequence[T], cost_of: Callable[[R], float]
    ) -> list[R]:
        """Return the results for all items, computed in threads, and report each."""
        stopped = threading.Event()
        with ThreadPoolExecutor() as pool:
            waiting = [pool.submit(work, item, stopped) for item in items]
            try:
                done = []
                for one in waiting:
                    done.append(one.result())
                    self.finish(cost_of(done[-1]))
                return done
            except BaseException:
                stopped.set()
                pool.shutdown(cancel_futures=True)
                raise


@dataclasses.dataclass(frozen=True)
class Fit:
    """Fitted preset, with residuals and Jacobian at the fit."""

    free: FreeParameters  # the fitted parameters
    preset: Preset  # the fitted preset
    cost: float  # sum over logs of the mean square error of the twin in MuJoCo, in units of `residuals`
    reduced_cost: float  # the same of the reduced twin, on which the search was made
    jacobian: Array  # derivative of the residuals with respect to the search space, (R, P)
    residual: Array  # residuals, weighted as at the end of the search, (R,)
    # points of the walks near the fit of the reduced twin, (K, 1 + P): rise of the cost, and distance in
    # the search space
    neighbours: Array = dataclasses.field(default_factory=lambda: np.empty((0, 0)))
    # parameters that are not fitted, although the motion depends on them, and derivatives with respect to
    # them, (R, F), and those of the sensor's zero with respect to the fitted and to these, (P + F,) [rad]
    fixed: tuple[str, ...] = ()
    fixed_jacobian: Array = dataclasses.field(default_factory=lambda: np.empty((0, 0)))
    zero_slope: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    # why the fit is that of the reduced twin alone, if it is; its costs and residuals are that twin's too
    unconfirmed: str = ""


CORRECTIONS = 20  # most, towards the twin in MuJoCo
DAMPINGS = (1e-4, 1e-2, 1.0)  # of a correction, tried in one batch
HELPS = 0.9999
"""Share of the cost that a correction may leave at most, or it was the last one. Of the cost of noise, a
thousandth is a standard deviation of a parameter."""
HALVINGS = 4  # most, of the time step where the simulation diverges
TRUSTED = 0.2  # farthest that a correction moves a parameter, on the scale of the search


def confirmed(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    numbers: Array,
    weight: float,
    jacobian: Callable[[Array, Array | None], Array],
    counted: Sequence[MeasuredLoop],
) -> Fit:
    """Move a fit of the reduced twin to where the twin in MuJoCo agrees with the logs.

    A Gauss-Newton step takes the residuals from MuJoCo and their derivatives from the reduced twin, which
    are the same but for MuJoCo's own step. It is damped (Levenberg and Marquardt), and kept where it helps.
    `jacobian` returns the derivative of the reduced twin's residuals at a point (P,), given the last one
    (R, P); costs are stated by the scales of the `counted` logs.
    """
    reduced = residuals([free.decode(numbers)], counted, "reduced")[0]
    count = len(reduced)  # what follows is the departure from the first guess
    try:
        base = free.base.replace(time_step=steady(free.decode(numbers), loops).time_step)
    except DivergedError as error:  # minutes of search are not thrown away
        cost, slope = float(reduced @ reduced), jacobian(numbers, None)[:count]
        left = penalised(free, [numbers], loops, "reduced", weight)[0][:count]
        return Fit(free, free.decode(numbers), cost, cost, slope, left, unconfirmed=str(error))
    free = dataclasses.replace(free, base=base)
    valley = Valley(free)
    slope, off = jacobian(numbers, None), penalised(free, [numbers], loops, "mujoco", weight)[0]
    for _ in range(CORRECTIONS):
        along = valley.slope(slope, numbers)
        normal, downhill = along.T @ along, along.T @ off
        scale = np.diag(np.diag(normal) + 1e-12)
        ways = [np.linalg.solve(normal + damping * scale, downhill) for damping in DAMPINGS]
        ends = [valley.straight(numbers) - np.clip(way, -TRUSTED, TRUSTED) for way in ways]
        tried = [valley.within(end) for end in ends]
        then = penalised(free, tried, loops, "mujoco", weight)
        best = int(np.argmin((then**2).sum(axis=1)))
        if not float(then[best] @ then[best]) < HELPS * float(off @ off):
            break
        numbers, off = tried[best], then[best]
        slope = jacobian(numbers, slope)
    return Fit(
        free=free,
        preset=free.decode(numbers),
        cost=float((residuals([free.decode(numbers)], counted) ** 2).sum()),
        reduced_cost=float(reduced @ reduced),
        jacobian=slope[:count],
        residual=off[:count],
    )


def steady(preset: Preset, loops: Sequence[MeasuredLoop]) -> Preset:
    """Return a preset with a time step at which MuJoCo follows every log: its own, or a part of it."""
    for halving in range(HALVINGS + 1):
        finer = preset.replace(time_step=preset.time_step / 2**halving)
        if None not in predict([finer], loops)[0]:
            return finer
    lost = [loop.name for loop, made in zip(loops, predict([finer], loops)[0], strict=True) if made is None]
    raise DivergedError(
        f"the twin diverges in MuJoCo along {', '.join(lost)}, even at steps of {finer.time_step:g} s: "
        "this is the fit of the reduced twin; fit fewer parameters with `free`, or take another `preset`"
    )


PROBE = 0.02  # of a parameter on the scale of the search, to either side


def with_fixed_parameters(fit: Fit, loops: Sequence[MeasuredLoop]) -> Fit:
    """Return a fit with the parameters that were not fitted, and what depends on them."""
    two_planes = fit.preset.bending_planes == 2
    fixed = tuple(
        name
        for name in DEFAULT
        if name not in (*fit.free.names, "command_zero")  # not fitted, commands count from neutral
        and (two_planes or not name.startswith("lateral"))
        and (name in SIGNED or getattr(fit.preset, name) > 0)
    )
    names = (*fit.free.names, *fixed)
    free = FreeParameters(fit.preset, names)
    ends = [free.decode(free.start + side * PROBE * row) for side in (1, -1) for row in np.eye(len(names))]
    off = residuals(ends, loops, "reduced")
    offsets = np.array([own_offsets(episodes, loops) for episodes in predict(ends, loops, "reduced")])
    zeros = -offsets.mean(axis=1) if offsets.size else np.zeros(len(ends))
    slope, of_zero = ((of[: len(names)] - of[len(names) :]) / (2 * PROBE) for of in (off, zeros))
    return dataclasses.replace(
        fit, fixed=fixed, fixed_jacobian=slope[len(fit.free.names) :].T, zero_slope=of_zero
    )


SCREENED = 40  # candidates that are tried for each start of least squares
STARTS = 12  # starts of least squares: valleys are many, and the best one by the fitted samples is taken
FINISHED = 2  # the best starts, which are followed to the bottom
MIRRORED = ("initial_bend", "lateral_initial_bend")  # each sign of them may have a valley of its own
LOWER = 0.9999  # share of the cost below which another valley is lower
TURNS = 3  # most times that the first guess is given less weight, where the logs leave little unexplained
SPREAD = 0.6  # of the candidates about the first guess: a factor of 1.8 on the scale of the search
WALK = 4  # stages of a walk: to the bottom, to either side, and to where it lands
STRONG = 6.0  # difference of the information criterion that is strong evidence
MOST_SPARED = 0.02  # share by which the cost may rise without a parameter
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
    (SciPy's `trf`) starts from the best of them, and continues to the minimum from the best of these, and
    from there with the initial bend reversed. Walks along its valley then look for a lower one. `confirmed`
    moves the fit to where the twin in MuJoCo agrees with the logs.
    """
    if not loops:
        raise InputError("no log to calibrate on")
    check_effort(starts, seed)
    turns = min(FINISHED, starts) + len(MIRRORED) + TURNS
    count = len(structures) + starts + turns + len(SPARED) + WALK * len(STRIDES) + 1
    key = _key(structures, loops, seed, starts) if state_file else ""
    stages = Stages(count, state_file, key, on_progress)
    search = _Search(structures, loops, starts, stages)
    begun = search.screen(np.random.default_rng(seed))
    down = search.descend("start", begun, STEPS, smooth=False)
    best = sorted(down, key=lambda one: one[0])[:FINISHED]
    finished = search.descend("finish", [(which, x) for _, which, x in best], MOST_STEPS)
    cost, which, numbers = search.mirror(*min(finished, key=lambda one: one[0]))
    free, weight = structures[which], PRIOR
    for turn in range(TURNS):
        left = float((residuals([free.decode(numbers)], loops, "reduced") ** 2).sum())
        if prior_weight(left, loops) < 0.8 * weight:
            weight = prior_weight(left, loops)
            cost, _, numbers = search.descend(f"turn {turn}", [(which, numbers)], MOST_STEPS, weight)[0]
        else:
            stages.finish(cost)
    for name in SPARED:
        which, cost, numbers = search.spare(name, which, cost, numbers, weight)
    free = search.structures[which]
    if weight < PRIOR:
        for number in range(len(STRIDES)):
            left_of = residuals([free.decode(numbers)], loops, "reduced")[0]
            search.loops = weighed(loops, left_of)
            cost, numbers = search.walk(number, which, numbers, weight)
    else:  # the unexplained part outweighs the differences between neighbouring valleys
        stages.finish(cost, WALK * len(STRIDES))
    fit = confirmed(
        free,
        search.loops,
        numbers,
        weight,
        jacobian=lambda at, around: smoothed_jacobian(free, search.loops, at, weight, around),
        counted=loops,
    )
    stages.finish(cost)
    fit = dataclasses.replace(fit, neighbours=search.neighbours(which, numbers, weight))
    return with_fixed_parameters(fit, search.loops)


def check_effort(starts: int, seed: int) -> None:
    """Refuse an impossible number of starts or seed."""
    check_between("starts", starts, 1, MOST_STARTS)
    check_between("seed", seed, 0, MOST_SEED)


def foreseen_seconds(
    structures: Sequence[FreeParameters], loops: Sequence[MeasuredLoop], starts: int
) -> float:
    """Return about how long a search takes on this machine [s], from the time of a few simulations."""
    free = structures[0]
    residuals([free.base], loops, "reduced")  # compiling and loading are not part of it
    begun = time.perf_counter()
    residuals([free.base] * TRIALS, loops, "reduced")
    each = (time.perf_counter() - begun) / TRIALS
    step = len(free.names) + 2
    descents = STEPS * step * starts + USUAL_STEPS * 2 * step * (min(FINISHED, starts) + 1)
    walks = len(STRIDES) * (2 * USUAL_WALK * STEPS * step + USUAL_STEPS * 2 * step)
    return each * (SCREENED * starts + descents + walks)


class _Search:
    """Search of one calibration: its logs as they are weighed, and the points of its walks."""

    def __init__(
        self, structures: Sequence[FreeParameters], loops: Sequence[MeasuredLoop], starts: int, stages: Stages
    ) -> None:
        self.structures, self._starts, self._stages = [*structures], starts, stages
        self.loops = list(loops)
        self._met: list[Array] = []

    def screen(self, rng: np.random.Generator) -> list[tuple[int, Array]]:
        """Return the best of random candidates: which structure, and where."""
        begun: list[tuple[int, Array]] = []
        for which, free in enumerate(self.structures):
            share = len(range(which, self._starts, len(self.structures)))
            drawn = rng.normal(size=(max(share * SCREENED, 1), len(free.names)))
            drawn[0] = 0.0
            candidates = np.clip(free.start + SPREAD * drawn, free.lower, free.upper)
            cost = self._stages.once(
                f"screen {which}", (len(candidates),), functools.partial(self._costs, free, candidates)
            )
            begun += [(which, candidates[place]) for place in np.argsort(cost, kind="stable")[:share]]
            self._stages.finish(float(cost.min()))
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
                    self.structures[which],
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

    def mirror(self, cost: float, which: int, numbers: Array) -> tuple[float, int, Array]:
        """Return a point (P,), or where one with a reversed initial bend descends to, if that is lower.

        Where the sensor's zero is not known, a log may have begun at either end of a slack plateau.
        """
        names = self.structures[which].names
        begun = [numbers * [-1 if name == of else 1 for name in names] for of in MIRRORED if of in names]
        self._stages.finish(cost, len(MIRRORED) - len(begun))
        reached = self.descend("mirror", [(which, start) for start in begun], MOST_STEPS)
        lowest = min(reached, key=lambda one: one[0], default=(cost, which, numbers))
        return lowest if lowest[0] < LOWER * cost else (cost, which, numbers)

    def spare(
        self, name: str, which: int, cost: float, numbers: Array, weight: float
    ) -> tuple[int, float, Array]:
        """Return structure, cost and place of the fit without a parameter, if the logs do not need it.

        They do on strong evidence: if the fit without it is worse by 6 in the Bayesian information criterion
        (Schwarz 1978; Kass and Raftery 1995), and by 2 %: errors of the twin are no independent evidence.
        """
        free = self.structures[which]
        if name not in free.names or not any(loop.offset for loop in self.loops):
            self._stages.finish(cost)
            return which, cost, numbers
        place = free.names.index(name)
        self.structures.append(free.without(name))
        rest = len(self.structures) - 1
        ((then, _, found),) = self.descend(
            f"without {name}", [(rest, np.delete(numbers, place))], MOST_STEPS, weight
        )
        left = residuals([free.decode(numbers)], self.loops, "reduced")[0]
        rise = max((np.log(len(left)) + STRONG) / len(left), MOST_SPARED)
        if then - cost > rise * cost:
            return which, cost, numbers
        return rest, then, found

    def walk(self, number: int, which: int, numbers: Array, weight: float) -> tuple[float, Array]:
        """Return the cost and place of the lowest valley that a walk to both sides finds, or of this one."""
        free = self.structures[which]
        name = parameter_along(free)
        ((cost, _, numbers),) = self.descend(f"bottom {number}", [(which, numbers)], MOST_STEPS, weight)
        if name is None:
            self._stages.finish(cost, WALK - 1)
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
        sides = self._stages.side_by_side(side, strides, lambda points: float(points[:, 0].min()))
        met = np.concatenate(sides)
        self._met.append(met[:, 1:])
        lowest = met[met[:, 0].argmin(), 1:]
        ((reached, _, end),) = self.descend(f"landing {number}", [(which, lowest)], MOST_STEPS, weight)
        return (reached, end) if reached < LOWER * cost else (cost, numbers)

    def neighbours(self, which: int, numbers: Array, weight: float) -> Array:
        """Return `Fit.neighbours`: of the points of all walks, the lowest within each shortest stride."""
        free = self.structures[which]
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
        inputs += [loop.name, loop.sample_time, loop.pull_in(0), loop.pull_in(1), loop.bend_in(0)]
        inputs += [loop.bend_in(1), loop.tension, loop.sheath_bend, loop.fitted, loop.seen, loop.scales]
        inputs += [loop.offset, loop.timed, loop.origin]
    return state_key(*inputs)
