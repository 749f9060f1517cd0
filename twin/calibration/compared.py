"""Logs, their simulation, and models without physics that were fitted to the same part."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.logs import MeasuredLoop
from twin.calibration.objective import (
    as_read,
    bend_errors,
    in_its_sheath,
    offset_of,
    offsets_taken_off,
    predict,
)
from twin.episode import Episode, Record, runs_of_true
from twin.errors import DivergedError, InputError
from twin.hysteresis import HysteresisModel, PrandtlIshlinskii
from twin.identification import identify
from twin.identification.nuisances import Log, Nuisances, determines_delay, fit_nuisances, records_of
from twin.preset.preset import Preset
from twin.simulation import simulate_batch

Array = NDArray[np.float64]

GENERATIONS = 40  # of the genetic algorithms: they find the basin, least squares goes to its bottom
STARTS, WAY = 33, 16  # pulls that a log may have begun after; samples of the way to each, and back
TWIN = "twin"  # name of the twin among those that are compared


def rival_errors(name: str, loops: Sequence[MeasuredLoop], seed: int, plane: int = 0) -> list[Array | None]:
    """Fit a model to the fitted samples and return how far it is above each measured angle.

    The model begins at the first angle that was measured. The zero of each angle and, where a log determines
    it, a delay of the command are fitted with it, as they are with the twin.

    Returns:
        The error at all samples of each log (N,) [rad]; None where there is no such angle, or the fitted part
        does not move or never turns back.
    """
    bends = np.array([loop.sheath_bend or 0.0 for loop in loops])
    fitted = np.unique([bend for bend, loop in zip(bends, loops, strict=True) if loop.fitted.any()])
    errors: list[Array | None] = [None] * len(loops)
    if fitted.size:
        nearest = np.abs(bends[:, None] - fitted).argmin(axis=1)
        for group in range(len(fitted)):
            places = np.flatnonzero(nearest == group).tolist()
            found = _errors_of(name, [loops[place] for place in places], seed, plane)
            for place, error in zip(places, found, strict=True):
                errors[place] = error
    return errors


def _errors_of(name: str, loops: Sequence[MeasuredLoop], seed: int, plane: int) -> list[Array | None]:
    logs = _logs(loops, plane, centred=name != PrandtlIshlinskii.name)
    fitted = [log for log in logs if log is not None and log.pieces]
    step = loops[0].sample_time
    found = Nuisances((0.0,) * len(fitted))
    try:
        model, _ = identify(records_of(fitted, found, step), seed, name, generations=GENERATIONS)
        if any(log.has_offset or log.has_delay for log in fitted):
            model, _, found = fit_nuisances(model, fitted, step)
    except (InputError, DivergedError):  # their rules on loops are stricter than those of a calibration
        return [None] * len(loops)
    offsets = dict(zip(map(id, fitted), found.offsets_deg, strict=True))
    usual = float(np.mean(found.offsets_deg))  # of a log that is only predicted: its own is not known
    return [
        None if log is None else _error(model, log, offsets.get(id(log), usual), found.delay_s, step)
        for log in logs
    ]


def _error(model: HysteresisModel, log: Log, offset_deg: float, delay_s: float, step: float) -> Array | None:
    """Return the error of a model along a complete log (N,) [rad]; None where it diverges."""
    complete = dataclasses.replace(log, pieces=((0, len(log.record.time)),))
    ((pull, bend),) = records_of([complete], Nuisances((offset_deg,), delay_s), step)
    with np.errstate(over="ignore", invalid="ignore"):
        error: Array = np.radians(model.response(pull, bend[0]) - bend)
    return error if np.isfinite(error).all() else None


def _logs(loops: Sequence[MeasuredLoop], plane: int, *, centred: bool) -> list[Log | None]:
    """Return the command and angle of a plane of each log, None where it has no such angle.

    Models that are odd about zero cannot follow logs with another middle: they get command and angle about
    the middle of the fitted samples. A play starts from rest at zero: its model gets them unchanged.
    """
    pairs = [(loop, loop.pull_in(plane), loop.bend_in(plane)) for loop in loops]
    fitted = [(pull[loop.fitted], bend[loop.fitted]) for loop, pull, bend in pairs if bend.size]
    joined = np.concatenate([np.empty((2, 0)), *map(np.array, fitted)], axis=1)
    middle, zero = (joined.max(axis=1) + joined.min(axis=1)) / 2 if centred and joined.size else (0.0, 0.0)
    return [
        Log(
            Record(
                np.arange(len(pull), dtype=float) * loop.sample_time,
                (pull - middle) * 1e3,
                measured_deg=np.degrees(bend - zero),
            ),
            tuple((begin, end) for begin, end in runs_of_true(loop.fitted) if end - begin > 1),
            has_offset=loop.offset and centred,
            has_delay=loop.timed and determines_delay(pull * 1e3),
        )
        if bend.size
        else None
        for loop, pull, bend in pairs
    ]


@dataclasses.dataclass(frozen=True)
class Compared:
    """Log, with the errors of the twin and its rivals.

    `errors` are, for each bending plane, simulated less measured angle by name, (N,) [rad]; None where there
    is nothing to compare. Offsets of a fitted log's angle are taken off, of the twin's those that the fit
    allows: `offsets` in each plane [rad], less what windows of a file share; zero if not fitted.
    """

    loop: MeasuredLoop
    episode: Episode | None  # its simulation; None where it diverged
    errors: tuple[Mapping[str, Array | None], ...]
    offsets: tuple[float, ...]
    own_start: Array | None = None  # error (N,) of `own_start_error` in the first plane [rad]


def compare(
    preset: Preset, loops: Sequence[MeasuredLoop], seed: int = 0, rivals: Sequence[str] = ()
) -> list[Compared]:
    """Simulate a calibrated preset along every log, and fit its rivals to the same samples."""
    episodes = predict([preset], loops)[0]
    planes = range(max(loop.planes for loop in loops))
    pairs = [*zip(loops, episodes, strict=True)]
    own = [bend_errors(episode, loop) for loop, episode in pairs]
    taken_off = offsets_taken_off(own, loops)
    theirs = {name: [rival_errors(name, loops, seed, plane) for plane in planes] for name in rivals}
    found = []
    for place, (loop, episode) in enumerate(pairs):
        errors, offsets = [], []
        for plane in planes[: loop.planes]:
            rivals_raw = {name: of_planes[plane][place] for name, of_planes in theirs.items()}
            raw = {TWIN: own[place][plane] if own[place] else None} | rivals_raw
            offset = {TWIN: float(taken_off[place][plane])}
            for name, error in rivals_raw.items():
                offset[name] = offset_of(error, loop) if error is not None and loop.fitted.any() else 0.0
            errors.append(
                {name: None if error is None else error - offset[name] for name, error in raw.items()}
            )
            offsets.append(offset[TWIN])
        own_start = own_start_error(preset, loop) if own[place] else None
        found.append(Compared(loop, episode, tuple(errors), tuple(offsets), own_start))
    return found


def own_start_error(preset: Preset, loop: MeasuredLoop) -> Array | None:
    """Return the error of the bend (N,) [rad] of a predicted log, less its mean, from the pose it began in.

    A device is left anywhere within its loop of hysteresis before a log begins, and no log tells where. The
    twin comes to the first command by way of one of `STARTS` other pulls: that which explains the log best on
    the reduced twin. None for a fitted log, one with a known zero, a window, or two bending planes.
    """
    if loop.fitted.any() or not loop.offset or loop.origin or preset.bending_planes == 2:
        return None
    starts = np.ptp(loop.episode.pull) / 2 * np.linspace(-1, 1, STARTS)
    tried = [error for error in _from_starts(preset, loop, starts, "reduced") if error is not None]
    if not tried:
        return None
    best = int(np.argmin([error.std() for error in tried]))
    return _from_starts(preset, loop, starts[best : best + 1], "mujoco")[0]


def _from_starts(preset: Preset, loop: MeasuredLoop, starts: Array, physics: str) -> list[Array | None]:
    """Return centred errors of the bend (N,) [rad] after a way from neutral by each of some pulls [m]."""
    preset, pull = in_its_sheath(preset, loop), loop.episode.pull
    pulls = [
        np.concatenate([np.linspace(0, start, WAY), np.linspace(start, pull[0], WAY)[1:-1], pull])
        for start in starts
    ]
    errors: list[Array | None] = []
    for episode in simulate_batch([preset] * len(pulls), pulls, loop.sample_time, physics=physics):
        log = None if episode is None else episode.part(-len(pull))
        raw = bend_errors(as_read(log, preset), loop)
        errors.append(raw[0] - offset_of(raw[0], loop) if raw else None)
    return errors


def errors_deg(error: Array | None, loop: MeasuredLoop) -> dict[str, float | None]:
    """Return the RMSE of an error (N,) [rad] where a log was fitted and where it was only predicted [deg]."""
    if error is None:
        return dict.fromkeys(("rmse_deg", "held_out_rmse_deg", "held_out_centred_rmse_deg"))
    off, held_out = np.degrees(error), ~loop.fitted & loop.seen
    centred = off[held_out] - off[held_out].mean() if held_out.any() else off[:0]
    return {
        "rmse_deg": rmse(off[loop.fitted]),
        "held_out_rmse_deg": rmse(off[held_out]),
        "held_out_centred_rmse_deg": rmse(centred),
    }


def rmse(off: Array) -> float | None:
    """Return the root mean square of errors, or None if there are none."""
    return float(np.sqrt(np.mean(off**2))) if off.size else None
