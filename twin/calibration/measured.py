"""Preparation of measured logs for calibration: checks, resampling to an even grid, playback speed."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError

Array = NDArray[np.float64]

LEAST_MOTION = 1e-6  # [m]
LEAST_TENSION = 1e-3  # [N]
LEAST_BEND = 1e-6  # [rad]
MOST_SAMPLES = 1_000_000  # of a log, on the grid
MOST = {"command": (10.0, "m"), "angle": (100.0, "rad"), "tension": (1e6, "N")}
"""Largest plausible values: beyond them squares of residuals overflow."""
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
    """

    name: str
    sample_time: float
    pull: Array
    bend: Array
    tension: Array
    sheath_bend: float | None
    fitted: NDArray[np.bool_]

    def only_predicted(self) -> "MeasuredLoop":
        """Return the log with no fitted sample, for prediction only."""
        return dataclasses.replace(self, fitted=np.zeros_like(self.fitted))

    @property
    def tension_range(self) -> float:
        """Range of the measured tensions [N]."""
        return float(np.ptp(self.tension)) if self.tension.size else math.nan


def measured_loop(
    episode: Episode, name: str, sample_time: float, *, pace: float | None = None, fraction: float = 1.0
) -> MeasuredLoop:
    """Check a log and resample it linearly to an even grid; missing measurements are not fitted.

    Args:
        episode: the log; its measured bending angle is what counts.
        name: name of the log in messages.
        sample_time: of the grid [s].
        pace: playback speed relative to the recording. Without it, the recorded pace; a log of
            phases, which has none, is played at `SIMULATED_SECONDS_PER_CYCLE`.
        fraction: share of the log, from its start, that is fitted.

    Raises:
        ValueError: the command does not move or never reverses, or a value is out of range.
    """
    if pace is None:
        recorded = episode.metadata.get("seconds_per_cycle")
        pace = float(recorded) / SIMULATED_SECONDS_PER_CYCLE if recorded else 1.0
    if not 0 < pace < math.inf:
        raise InputError(f"pace = {pace}: must be positive")
    if not 0 < fraction <= 1:
        raise InputError(f"fraction = {fraction}: must be above 0 and at most 1")
    if not 0 < sample_time < math.inf:
        raise InputError(f"sample time {sample_time:g} s: must be positive")
    _check_fits(episode, name)
    time = (episode.time - episode.time[0]) / pace
    even = dataclasses.replace(episode, time=time)
    if time[-1] / sample_time > MOST_SAMPLES:
        raise InputError(
            f"{name}: {time[-1]:.3g} s in samples of {sample_time:g} s are more than {MOST_SAMPLES}"
        )
    count = int(time[-1] / sample_time) + 1
    fitted = np.arange(count) < round(fraction * count)
    if fitted.sum() < 10:
        played = "" if pace is None else f", played at the pace of {pace:g},"
        raise InputError(
            f"{name}: {fitted.sum()} samples of {sample_time:g} s{played} to fit: needs at least 10"
        )
    even = even.on_grid(sample_time)
    seen = ~np.isnan(even.measured_bend)
    fitted &= seen
    if fitted.sum() < 10:
        raise InputError(f"{name}: {fitted.sum()} measured samples to fit: needs at least 10")
    bend = np.interp(even.time, even.time[seen], even.measured_bend[seen])
    pull, tension = even.pull, even.wire_tension[:, :2, 0:1].reshape(count, -1)
    for what, values in (("command", pull), ("angle", bend), ("tension", tension)):
        limit, unit = MOST[what]
        if values.size and not np.abs(values).max() <= limit:
            raise InputError(f"{name}: {what} of {np.abs(values).max():.3g} {unit}: must be within {limit:g}")
    _check_motion(pull[fitted], name)
    if np.ptp(bend[fitted]) < LEAST_BEND:
        raise InputError(f"{name}: the angle does not change: nothing to calibrate on")
    if np.corrcoef(pull[fitted], bend[fitted])[0, 1] < -0.5:
        raise InputError(f"{name}: the angle falls where the command rises: import it with `reverse_angle`")
    if tension.size and np.ptp(tension) < LEAST_TENSION:
        raise InputError(f"{name}: the tensions do not change: import it without them")
    sheath_bend = float(episode.sheath_bend[0]) if episode.sheath_bend.size else None
    return MeasuredLoop(name, sample_time, pull, bend, tension, sheath_bend, fitted)


def _check_fits(episode: Episode, name: str) -> None:
    """Check that the log has one bending plane and a constant sheath bend."""
    if episode.sheath_bend.size and np.ptp(episode.sheath_bend) > 1e-3:
        raise InputError(f"{name}: the sheath's bend changes: calibrate on logs in which it stands still")
    if episode.lateral_pull.size and np.ptp(episode.lateral_pull) > LEAST_MOTION:
        raise InputError(f"{name}: wires c and d are pulled too: calibrate on logs of one bending plane")


def _check_motion(pull: Array, name: str) -> None:
    span = np.ptp(pull)
    if span < LEAST_MOTION:
        raise InputError(f"{name}: the command moves by {span * 1e3:.2g} mm: nothing to calibrate on")
    # The farthest way back from the highest, or up from the lowest, point so far.
    back = (np.maximum.accumulate(pull) - pull).max()
    forth = (pull - np.minimum.accumulate(pull)).max()
    if min(back, forth) < 0.05 * span:
        raise InputError(f"{name}: the command never reverses: friction shows only on the way back")
