"""Nuisances of measured logs, fitted with a model: the zero of each angle, and a delay of the command.

A sensor is set to zero at some pose, and a controller acts some time after its command was logged. Neither is
hysteresis, and neither becomes part of the model, but a model that is fitted without them is biased by them.
From the basin that the genetic algorithm has found, model and nuisances go to its bottom together by least
squares (Branch, Coleman and Li 1999, in scipy).
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares, minimize_scalar

from twin.episode import Record
from twin.errors import InputError
from twin.hysteresis import MODELS, BoucWen, ColemanHodgdon, HysteresisModel, PrandtlIshlinskii
from twin.identification import models
from twin.identification.search import Records, Stack

Array = NDArray[np.float64]

LARGEST_DELAY_S = 0.5  # largest delay of a command [s]: no controller has a longer one
LARGEST_OFFSET_DEG = 180.0  # magnitude of the largest offset of an angle [deg]
LEAST_SPREAD = 0.25
"""Standard deviation of a command's speed, over its mean, that determines a delay; a sine has 0.48."""
FIRST_DELAYS_S = (0.0, 0.1, 0.3)  # delays that the fit begins from: its error has a kink at each sample time
FIRST_STEPS, MOST_STEPS = 6, 60
"""Largest number of steps of least squares from each of them, and from the best result."""

_OFFSET_SCALE_DEG = 10.0  # variables of the fit are of the order of one
_DELAY_SCALE_S = 0.1
_DIFFERENCE = 1e-6  # of variables, in their derivatives
_LARGEST_ERROR_DEG = 1e6  # of a response that diverges


@dataclasses.dataclass(frozen=True)
class Log:
    """A record at even samples, its pieces without missing measurements, and the nuisances that it has."""

    record: Record  # of the measured angle
    pieces: tuple[tuple[int, int], ...]  # first sample of each piece and the one after its last
    has_offset: bool = False  # whether its angle has a zero of its own
    has_delay: bool = False  # whether its command acts later than it was logged


@dataclasses.dataclass(frozen=True)
class Nuisances:
    """Fitted nuisances; zero where none was fitted."""

    offsets_deg: tuple[float, ...]  # angle of each log's zero, (logs,) [deg]
    delay_s: float = 0.0  # delay of the command of those logs that have one [s]


def records_of(logs: Sequence[Log], nuisances: Nuisances, sample_time: float) -> Records:
    """Return command and angle of each piece of each log, without nuisances."""
    records = []
    for log, offset in zip(logs, nuisances.offsets_deg, strict=True):
        pull = log.record.pull_mm
        if log.has_delay and nuisances.delay_s:
            place = np.arange(len(pull), dtype=float)
            pull = np.interp(place - nuisances.delay_s / sample_time, place, pull)
        records += [
            (pull[begin:end], log.record.measured_deg[begin:end] - offset) for begin, end in log.pieces
        ]
    return records


def error_of(model: HysteresisModel, logs: Sequence[Log], nuisances: Nuisances, sample_time: float) -> Array:
    """Return response minus angle at every sample of every piece, one after the other, (..., samples) [deg].

    A model of candidates has parameters of shape (candidates, 1), as in `mean_square_error`.
    """
    stack = Stack(records_of(logs, nuisances, sample_time))
    with np.errstate(over="ignore", invalid="ignore"):
        error = stack.error(model)[..., stack.weight]
    most = _LARGEST_ERROR_DEG
    return np.asarray(np.nan_to_num(error, nan=most).clip(-most, most))


def determines_delay(pull_mm: Array) -> bool:
    """Return whether a command (N,) [mm] separates delay and hysteresis: it must have more than one speed.

    At a single speed, as with a triangle, a delay is a play of the width that the command covers in it.
    """
    speed = np.abs(np.diff(pull_mm))
    moving = speed[speed > 0.05 * speed.max(initial=0.0)]
    return bool(moving.size and moving.std() > LEAST_SPREAD * moving.mean())


def rmse_from(
    model: HysteresisModel,
    logs: Sequence[Log],
    first: Sequence[int],
    nuisances: Nuisances,
    sample_time: float,
) -> float:
    """Return the RMSE of a model's prediction of the samples of each log from a first one on [deg].

    The response begins at the first sample of each piece, which may be before.
    """
    starts = zip(logs, first, strict=True)
    scored = np.concatenate([np.arange(*piece) >= start for log, start in starts for piece in log.pieces])
    if not scored.any():
        raise InputError("no measurement is left to predict")
    error = error_of(model, logs, nuisances, sample_time)[scored]
    return float(np.sqrt(np.mean(error**2)))


def fit_nuisances(
    model: HysteresisModel,
    logs: Sequence[Log],
    sample_time: float,
    *,
    monotone: bool = False,
    thresholds_mm: Sequence[float] = (),
) -> tuple[HysteresisModel, float, Nuisances]:
    """Fit a model and the nuisances of its logs together.

    A Prandtl-Ishlinskii model has no zero of the angle, only increments: its logs get no offset.

    The model was identified from the logs without nuisances. Returns the model, its RMSE over all samples
    [deg], and the nuisances.
    """
    if isinstance(model, PrandtlIshlinskii):
        return _fit_delay(logs, sample_time, thresholds_mm)
    if isinstance(model, BoucWen):
        return _fit_together(models.bouc_wen_at, models.bouc_wen_point(model), logs, sample_time)
    if not isinstance(model, ColemanHodgdon):
        raise InputError(f"{model.name}: nuisances are fitted with {', '.join(MODELS)} only")
    start = models.coleman_hodgdon_point(model, monotone)
    return _fit_together(lambda unit: models.coleman_hodgdon_at(unit, monotone), start, logs, sample_time)


def _fit_together(
    model_at: Callable[[Array], BoucWen | ColemanHodgdon],
    start: Array,
    logs: Sequence[Log],
    sample_time: float,
) -> tuple[HysteresisModel, float, Nuisances]:
    """Fit a model from a point of the unit cube on, together with the nuisances."""
    count = len(start)
    shifted = [place for place, log in enumerate(logs) if log.has_offset]
    delayed = int(any(log.has_delay for log in logs))

    def nuisances_at(point: Array) -> Nuisances:
        offsets = np.zeros(len(logs))
        offsets[shifted] = point[count : count + len(shifted)] * _OFFSET_SCALE_DEG
        delay = point[-1] * _DELAY_SCALE_S if delayed else 0.0
        return Nuisances(tuple(map(float, offsets)), float(delay))

    def errors(point: Array) -> Array:
        return error_of(model_at(point[:count]), logs, nuisances_at(point), sample_time)

    def derivatives(point: Array) -> Array:
        """Return one-sided differences, those of all parameters of the model in one batch."""
        here, steps = errors(point), np.where(point + _DIFFERENCE <= upper, _DIFFERENCE, -_DIFFERENCE)
        ends = point + np.diag(steps)
        candidates = model_at(ends[:count, :count].T[..., None])
        of_model = error_of(candidates, logs, nuisances_at(point), sample_time)
        moved = np.concatenate([of_model, np.reshape([errors(end) for end in ends[count:]], (-1, len(here)))])
        slopes: Array = ((moved - here) / steps[:, None]).T
        return slopes

    most = LARGEST_OFFSET_DEG / _OFFSET_SCALE_DEG
    lower = np.concatenate([np.zeros(count), np.full(len(shifted), -most), np.zeros(delayed)])
    upper = np.concatenate(
        [np.ones(count), np.full(len(shifted), most), np.full(delayed, LARGEST_DELAY_S / _DELAY_SCALE_S)]
    )

    def descend(first: Array, steps: int) -> OptimizeResult:
        return least_squares(
            errors, first, derivatives, bounds=(lower, upper), ftol=1e-8, xtol=1e-8, max_nfev=steps
        )

    begun = []
    for delay in FIRST_DELAYS_S if delayed else (0.0,):
        first = np.concatenate([start, np.zeros(len(shifted)), np.full(delayed, delay / _DELAY_SCALE_S)])
        begun.append(descend(first, FIRST_STEPS))
    best = descend(min(begun, key=lambda result: result.cost).x, MOST_STEPS)
    rmse = float(np.sqrt(np.mean(errors(best.x) ** 2)))
    return models.with_floats(model_at(best.x[:count])), rmse, nuisances_at(best.x)


def _fit_delay(
    logs: Sequence[Log], sample_time: float, thresholds_mm: Sequence[float]
) -> tuple[HysteresisModel, float, Nuisances]:
    """Fit a Prandtl-Ishlinskii model, whose weights are a convex problem at each delay."""
    none = Nuisances((0.0,) * len(logs))

    def fit(delay: float) -> tuple[PrandtlIshlinskii, float]:
        records = records_of(logs, dataclasses.replace(none, delay_s=delay), sample_time)
        return models.identify_prandtl_ishlinskii(records, thresholds_mm=thresholds_mm)

    if not any(log.has_delay for log in logs):
        return *fit(0.0), none
    delays = np.linspace(0, LARGEST_DELAY_S, 11)
    best = int(np.argmin([fit(float(delay))[1] for delay in delays]))
    around = delays[max(best - 1, 0)], delays[min(best + 1, len(delays) - 1)]
    delay = float(minimize_scalar(lambda value: fit(value)[1], bounds=around, method="bounded").x)
    delay = min((0.0, delay), key=lambda value: fit(value)[1])
    return *fit(delay), dataclasses.replace(none, delay_s=delay)
