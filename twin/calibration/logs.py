"""Preparation of measured logs for calibration: checks, resampling to an even grid, playback speed."""

import collections
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.preset.preset import Preset
from twin.signals.sensor import estimated_variance

Array = NDArray[np.float64]

LEAST_MOTION = 1e-6  # [m]
LEAST_LATERAL_MOTION = 3e-4  # of a lateral command: less does not determine the sign of its angle [m]
AGAINST = -0.5  # correlation of command and angle below which the angle is counted the other way
LEAST_TENSION = 1e-3  # [N]
LEAST_BEND = 1e-6  # [rad]
FEWEST_FITTED = 10
MOST = {"command": (10.0, "m"), "angle": (100.0, "rad"), "tension": (1e6, "N")}
"""Largest plausible values: beyond them squares of residuals overflow."""
USUAL_SAMPLES = 900  # that a calibration compares by default
LONGEST_PERIODS = 10  # between two samples, in control periods, where as many were recorded
BETWEEN = 4  # most samples for each that was recorded seldom: models of hysteresis step finely enough then
FEWEST = 40  # samples of such a log
AVERAGED = np.radians(0.1) ** 2  # noise above which readings are averaged; at corners that blurs as much
_PLACES = 8  # of a mean
SIMULATED_SECONDS_PER_CYCLE = 8.0
"""Simulated period of a log that has phases instead of times [s]: quasi-static, and quick to simulate."""


@dataclasses.dataclass(frozen=True)
class MeasuredLoop:
    """Measured log on an even time grid, and what a calibration adds to it."""

    name: str  # of the log in messages
    episode: Episode  # its `bend` is the measured one, linear where it is missing
    fitted: NDArray[np.bool_]  # mask of the samples that are fitted, (N,); the others are only predicted
    seen: NDArray[np.bool_]  # mask of the samples that were measured, (N,)
    offset: bool = False  # whether the zero of the angle is unknown, as that of a measured one is
    timed: bool = False  # whether its times were recorded; a log of phases has none
    # error of each channel that costs 1, angles before tensions, (C,) [rad, N]; (0,) for the usual ones
    scales: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    reading_noise: tuple[float, ...] = ()  # variance of a reading of each angle, as estimated [rad^2]
    reading_step: float = 0.0  # time between two readings [s]
    origin: str | None = None  # of a window, the file that it was cut from; see `file_of_window`

    @property
    def sample_time(self) -> float:
        """Time between two samples [s]."""
        return self.episode.sample_time

    @property
    def tension(self) -> Array:
        """Measured tension of wires a and b at the pulley, (N, 2) [N]; (N, 0) without load cells."""
        return self.episode.wire_tension[:, :2, 0:1].reshape(len(self.episode.time), -1)

    @property
    def noise(self) -> Array:
        """Variance of the noise of each angle, after averaging, (planes,) [rad^2]; (0,) if unknown."""
        noise = np.array(self.reading_noise)
        return noise / _readings_averaged(noise, self.reading_step, self.sample_time)

    @property
    def sheath_bend(self) -> float | None:
        """Bend angle of the sheath [rad]; None if the log does not state it."""
        bend = self.episode.sheath_bend
        return float(bend[0]) if bend.size else None

    @property
    def planes(self) -> int:
        """Number of bending planes whose angle was measured."""
        return 1 + (self.episode.lateral_bend.size > 0)

    def only_predicted(self) -> "MeasuredLoop":
        """Return the log with no fitted sample, for prediction only."""
        return dataclasses.replace(self, fitted=np.zeros_like(self.fitted))

    def pull_in(self, plane: int) -> Array:
        """Return the command of a bending plane, (N,) [m]; zero in one that has none."""
        pull = self.episode.lateral_pull if plane else self.episode.pull
        return pull if pull.size else np.zeros_like(self.episode.pull)

    def bend_in(self, plane: int) -> Array:
        """Return the measured angle in a bending plane, (N,) [rad]; (0,) if there is none."""
        return self.episode.lateral_bend if plane else self.episode.bend


def thinned(
    episodes: Sequence[Episode], preset: Preset, pace: float | None = None, predicted: Sequence[Episode] = ()
) -> float:
    """Return the sample time at which logs have about `USUAL_SAMPLES` together, whole control periods [s].

    Logs that were recorded seldom, as poses are, are compared `BETWEEN` times as often, and no more, as long
    as the shortest has `FEWEST` samples.
    """
    everything = [*episodes, *predicted]
    seconds = [float(one.time[-1] - one.time[0]) / _pace(one, pace) for one in everything]
    own = min(length / max(len(one.time) - 1, 1) for length, one in zip(seconds, everything, strict=True))
    period = preset.control_period
    fitted = sum(seconds[: len(episodes)])
    usual = min(max(round(fitted / USUAL_SAMPLES / period), 1), LONGEST_PERIODS)
    seldom = min(own / BETWEEN, min(seconds) / FEWEST)
    return period * max(usual, math.floor(seldom / period))


def _pace(episode: Episode, pace: float | None) -> float:
    """Return how many times faster than recorded a log is played."""
    phases = episode.metadata.get("seconds_per_cycle")
    if pace is None:
        pace = float(phases) / SIMULATED_SECONDS_PER_CYCLE if phases else 1.0
    if not 0 < pace < math.inf:
        raise InputError(f"pace = {pace}: must be positive")
    return pace


def measured_loop(
    episode: Episode, name: str, sample_time: float, *, pace: float | None = None, fraction: float = 1.0
) -> MeasuredLoop:
    """Check a log and resample it linearly to an even grid; missing measurements are not fitted.

    A window of a longer record (`window` in its metadata) need not move or reverse: `check_windows` asks that
    of all windows together. `pace` is the playback speed relative to the recording, 1 by default; a log of
    phases has its own. The first `fraction` of the log is fitted.
    """
    speed = _pace(episode, pace)
    if episode.sheath_bend.size and np.ptp(episode.sheath_bend) > 1e-3:
        raise InputError(f"{name}: the sheath's bend changes: calibrate on logs in which it stands still")
    pulled = episode.lateral_pull.size and np.ptp(episode.lateral_pull) > LEAST_MOTION
    if pulled and not episode.lateral_bend.size:
        raise InputError(f"{name}: wires c and d are pulled, but the angle in their plane was not measured")
    time = (episode.time - episode.time[0]) / speed
    steps = np.diff(time)
    step = float(steps[steps < 1.5 * np.median(steps)].mean())  # no gaps
    if time[-1] < sample_time:  # a grid has two samples at least
        raise InputError(f"{name}: {time[-1]:.3g} s at the pace of {speed:g}: shorter than a sample")
    even = dataclasses.replace(episode, time=time).resampled(sample_time, "interpolate")
    count = len(even.time)
    seen = ~np.isnan(even.measured_bend)
    fitted = seen & (np.arange(count) < round(fraction * count))
    if fitted.sum() < FEWEST_FITTED:
        raise InputError(
            f"{name}: {fitted.sum()} measured samples of {sample_time:g} s to fit, at the pace of {speed:g}: "
            f"needs at least {FEWEST_FITTED}"
        )
    pull, tension = even.pull, even.wire_tension[:, :2, 0:1].reshape(count, -1)
    readings = [of for of in (episode.measured_bend, episode.lateral_bend) if of.size]
    noise = np.nan_to_num([estimated_variance(of) for of in readings])
    widths = np.where(_readings_averaged(noise, step, sample_time) > 1, sample_time, 0.0)
    bends = [_averaged(time, of, even.time, width) for of, width in zip(readings, widths, strict=True)]
    bend, lateral_bend = (*bends, even.lateral_bend)[:2]
    lateral_pull = even.lateral_pull
    for what, parts in (
        ("command", (pull, lateral_pull)),
        ("angle", (bend, lateral_bend)),
        ("tension", (tension,)),
    ):
        limit, unit = MOST[what]
        highest = max(np.abs(values).max(initial=0.0) for values in parts)
        if highest > limit:
            raise InputError(f"{name}: {what} of {highest:.3g} {unit}: must be within {limit:g}")
    if episode.metadata.get("window") is None:
        if fault := _wrong_motion(pull[fitted]):
            raise InputError(f"{name}: {fault}")
        check_angle(pull[fitted], bend[fitted], name)
        if lateral_pull.size and lateral_bend.size:
            check_angle(lateral_pull[fitted], lateral_bend[fitted], name, lateral=True)
    if tension.size and np.ptp(tension) < LEAST_TENSION:
        raise InputError(f"{name}: the tensions do not change: import it without them")
    return MeasuredLoop(
        *(name, dataclasses.replace(even, bend=bend, lateral_bend=lateral_bend), fitted, seen),
        offset=episode.is_measured,
        timed=episode.is_measured and not episode.metadata.get("seconds_per_cycle"),
        reading_noise=tuple(noise.tolist()),
        reading_step=step,
        origin=file_of_window(episode),
    )


def _readings_averaged(noise: Array, step: float, sample_time: float) -> Array:
    """Return how many readings, `step` apart [s], a sample is the mean of, by the noise of each angle."""
    readings = sample_time / step if step else 0.0
    return np.where((noise > AVERAGED) & (readings > 2), readings, 1.0)


def _averaged(time: Array, reading: Array, grid: Array, width: float) -> Array:
    """Return the means of readings (N,) over a width at a grid [s], linear between those that are known."""
    known = np.isfinite(reading)
    places = grid[:, None] + width * ((np.arange(_PLACES) + 0.5) / _PLACES - 0.5)
    mean: Array = np.interp(places, time[known], reading[known]).mean(axis=1)
    return mean


def file_of_window(episode: Episode) -> str | None:
    """Return what identifies the file that a window was cut from; None if it is a complete log or unknown."""
    facts = episode.metadata
    window, origin = facts.get("window"), facts.get("file_sha256")
    return None if window is None or origin is None else str(origin)


def windows_of_files(loops: Sequence[MeasuredLoop]) -> list[list[int]]:
    """Return the places of the windows of each file among logs."""
    origins = dict.fromkeys(loop.origin for loop in loops if loop.origin)
    return [[place for place, loop in enumerate(loops) if loop.origin == origin] for origin in origins]


def check_angle(pull: Array, bend: Array, name: str, *, lateral: bool = False) -> None:
    """Refuse an angle (N,) that runs against its command, or does not change; a lateral one may rest."""
    still = np.ptp(bend) < LEAST_BEND
    if still and not lateral:
        raise InputError(f"{name}: the angle does not change: nothing to calibrate on")
    if still or (lateral and np.ptp(pull) < LEAST_LATERAL_MOTION):
        return
    if np.corrcoef(pull, bend)[0, 1] < AGAINST:
        which = "lateral_" * lateral
        raise InputError(
            f"{name}: the {which.replace('_', ' ')}angle falls where its command rises: "
            f"import it with `reverse_{which}angle`"
        )


def _wrong_motion(pull: Array) -> str:
    """Return the fault of a command (N,) [m] that does not move, or never turns back; empty if it does."""
    span = np.ptp(pull)
    if span < LEAST_MOTION:
        return f"the command moves by {span * 1e3:.2g} mm: nothing to calibrate on"
    # The farthest way back from the highest, or up from the lowest, point so far.
    back = (np.maximum.accumulate(pull) - pull).max()
    forth = (pull - np.minimum.accumulate(pull)).max()
    if min(back, forth) < 0.05 * span:
        return "the command never reverses: friction shows only on the way back"
    return ""


ReadLog = tuple[Path, Episode]  # a log, and the path that it was read from


def first_windows(records: Sequence[ReadLog], fraction: float) -> tuple[list[ReadLog], list[ReadLog]]:
    """Divide logs into those to fit, and windows that are only predicted: the last of each file."""
    parts: tuple[list[ReadLog], list[ReadLog]] = ([], [])
    windows = collections.Counter(file_of_window(episode) for _, episode in records)
    wanted = {origin: max(round(fraction * count), 1) for origin, count in windows.items()}
    for record in records:
        origin = file_of_window(record[1])
        parts[origin is not None and wanted[origin] <= 0].append(record)
        wanted[origin] -= 1
    return parts


def check_windows(loops: Sequence[MeasuredLoop]) -> None:
    """Refuse windows of one file whose command reverses in none of them, or whose angle runs against it.

    One window may stand still or go one way: friction shows in the others.
    """
    for places in windows_of_files(loops):
        windows = [loops[place] for place in places]
        moves = [_wrong_motion(loop.episode.pull[loop.fitted]) for loop in windows]
        if all(moves):
            raise InputError(f"{windows[0].name}: {moves[0]}")
        pull, bend = (_joined(windows, field) for field in ("pull", "bend"))
        check_angle(pull, bend, windows[0].name)
        if all(loop.episode.lateral_pull.size and loop.episode.lateral_bend.size for loop in windows):
            pull, bend = (_joined(windows, field) for field in ("lateral_pull", "lateral_bend"))
            check_angle(pull, bend, windows[0].name, lateral=True)


def _joined(loops: Sequence[MeasuredLoop], field: str) -> Array:
    return np.concatenate([getattr(loop.episode, field)[loop.fitted] for loop in loops])
