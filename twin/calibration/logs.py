"""Preparation of measured logs for calibration: checks, resampling to an even grid, playback speed."""

import collections
import contextlib
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.preset.preset import Preset

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
SIMULATED_SECONDS_PER_CYCLE = 8.0
"""Simulated period of a log that has phases instead of times [s]: quasi-static, and quick to simulate."""


@dataclasses.dataclass(frozen=True)
class MeasuredLoop:
    """Measured log on an even time grid.

    Attributes:
        name: name of the log in messages.
        sample_time: time between two samples [s].
        pull: commanded pulling distance, (N,) [m].
        bend: measured bending angle, (N,) [rad].
        tension: measured tension of wires a and b at the pulley, (N, 2) [N]; (N, 0) without load cells.
        sheath_bend: bend angle of the sheath [rad]; None if the log does not state it.
        fitted: mask of the samples that are fitted, (N,); the others are only predicted.
        seen: mask of the samples that were measured, (N,).
        offset: whether the zero of the angle is unknown, as that of a measured one is.
        timed: whether its times were recorded; a log of phases has none.
        lateral_pull: commanded pulling distance of wire c, (N,) [m]; (0,) with one bending plane.
        lateral_bend: measured bending angle in that plane, (N,) [rad]; (0,) if there is none.
        scales: error of each channel that costs 1, its angles before its tensions, (C,) [rad, N]; (0,)
            for the usual ones.
        origin: of a window, the file that it was cut from; see `file_of_window`.
    """

    name: str
    sample_time: float
    pull: Array
    bend: Array
    tension: Array
    sheath_bend: float | None
    fitted: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    offset: bool = False
    timed: bool = False
    lateral_pull: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    lateral_bend: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    scales: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    origin: str | None = None

    def only_predicted(self) -> "MeasuredLoop":
        """Return the log with no fitted sample, for prediction only."""
        return dataclasses.replace(self, fitted=np.zeros_like(self.fitted))

    def pull_in(self, plane: int) -> Array:
        """Return the command of a bending plane, (N,) [m]; zero in one that has none."""
        pull = self.lateral_pull if plane else self.pull
        return pull if pull.size else np.zeros_like(self.pull)

    def bend_in(self, plane: int) -> Array:
        """Return the measured angle in a bending plane, (N,) [rad]; (0,) if there is none."""
        return self.lateral_bend if plane else self.bend

    @property
    def planes(self) -> int:
        """Number of bending planes whose angle was measured."""
        return 1 + (self.lateral_bend.size > 0)


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
    of all windows together.

    Args:
        episode: the log; its measured bending angle is what counts.
        name: name of the log in messages.
        sample_time: of the grid [s].
        pace: playback speed relative to the recording, 1 by default; a log of phases has its own.
        fraction: share of the log, from its start, that is fitted.
    """
    speed = _pace(episode, pace)
    if episode.sheath_bend.size and np.ptp(episode.sheath_bend) > 1e-3:
        raise InputError(f"{name}: the sheath's bend changes: calibrate on logs in which it stands still")
    pulled = episode.lateral_pull.size and np.ptp(episode.lateral_pull) > LEAST_MOTION
    if pulled and not episode.lateral_bend.size:
        raise InputError(f"{name}: wires c and d are pulled, but the angle in their plane was not measured")
    time = (episode.time - episode.time[0]) / speed
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
    bend = np.interp(even.time, even.time[seen], even.measured_bend[seen])
    pull, tension = even.pull, even.wire_tension[:, :2, 0:1].reshape(count, -1)
    lateral_pull, lateral_bend = even.lateral_pull, even.lateral_bend
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
        check_motion(pull[fitted], name)
        check_angle(pull[fitted], bend[fitted], name)
        if lateral_pull.size and lateral_bend.size:
            check_angle(lateral_pull[fitted], lateral_bend[fitted], name, lateral=True)
    if tension.size and np.ptp(tension) < LEAST_TENSION:
        raise InputError(f"{name}: the tensions do not change: import it without them")
    sheath_bend = float(episode.sheath_bend[0]) if episode.sheath_bend.size else None
    return MeasuredLoop(
        *(name, sample_time, pull, bend, tension, sheath_bend, fitted, seen),
        offset=episode.is_measured,
        timed=episode.is_measured and not episode.metadata.get("seconds_per_cycle"),
        lateral_pull=lateral_pull,
        lateral_bend=lateral_bend,
        origin=file_of_window(episode),
    )


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


def check_motion(pull: Array, name: str) -> None:
    """Refuse a command (N,) [m] that does not move, or never turns back."""
    span = np.ptp(pull)
    if span < LEAST_MOTION:
        raise InputError(f"{name}: the command moves by {span * 1e3:.2g} mm: nothing to calibrate on")
    # The farthest way back from the highest, or up from the lowest, point so far.
    back = (np.maximum.accumulate(pull) - pull).max()
    forth = (pull - np.minimum.accumulate(pull)).max()
    if min(back, forth) < 0.05 * span:
        raise InputError(f"{name}: the command never reverses: friction shows only on the way back")


Record = tuple[Path, Episode]
"""A log, and the path that it was read from."""


def first_windows(records: Sequence[Record], fraction: float) -> tuple[list[Record], list[Record]]:
    """Divide logs into those to fit, and windows that are only predicted: the last of each file."""
    parts: tuple[list[Record], list[Record]] = ([], [])
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
        if not any(_reverses(loop) for loop in windows):
            check_motion(windows[0].pull[windows[0].fitted], windows[0].name)
        pull, bend = (_joined(windows, field) for field in ("pull", "bend"))
        check_angle(pull, bend, windows[0].name)
        if all(loop.lateral_pull.size and loop.lateral_bend.size for loop in windows):
            pull, bend = (_joined(windows, field) for field in ("lateral_pull", "lateral_bend"))
            check_angle(pull, bend, windows[0].name, lateral=True)


def _joined(loops: Sequence[MeasuredLoop], field: str) -> Array:
    return np.concatenate([getattr(loop, field)[loop.fitted] for loop in loops])


def _reverses(loop: MeasuredLoop) -> bool:
    with contextlib.suppress(InputError):
        check_motion(loop.pull[loop.fitted], loop.name)
        return True
    return False
