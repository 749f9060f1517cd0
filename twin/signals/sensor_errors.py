"""Errors of a sensor along a record: faults of real ones, and the measured errors of the stereo sensor.

Each fault has Gaussian noise of known variance R, and a disturbance of one level that a filter does not know:
a drift, a memory, a mixture, steps, gaps, a delay, or a value that stays. No training run contains them,
except for noise like the mixture: see `rl.twins.noises`.

`assets/stereo_noise.json` holds what was measured of the stereo sensor: errors on a grid of angles, and gaps
where instruments hid it. An error depends on the angle, and less on chance: as the endoscope moves slowly,
errors of neighbouring samples are alike.
"""

import dataclasses
import functools
import json
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.files.assets import assets_folder

Array = NDArray[np.float64]
Hidden = NDArray[np.bool_]
# Errors (N,) [deg] of a level along a true angle (N,) [deg] every T [s], NaN where nothing is seen.
Draw = Callable[[float, Array, float, np.random.Generator], Array]

KNOWN_DEG2 = 1.0  # known R of a sensor that has a fault [deg^2]
FINE_DEG2 = 0.1  # R of a sensor that counts in steps, besides them [deg^2]
GAP_S = 1.0  # mean length of a gap [s]; lengths are drawn exponentially
STUCK_S = 2.0  # for which a sensor repeats its last value [s]
_FINEST_DEG = 1e-9  # steps below it are none [deg]
_SEEN_WELL, _SEEN_BADLY, _BADLY = 0.8, 0.2, 3.0  # shares of a mixture, and how much wider the second is


@dataclasses.dataclass(frozen=True)
class SensorErrors:
    """Kind of errors that a sensor makes along a record."""

    label: str  # in words with a place for the level, for tables
    unit: str  # of the level, in words
    most: float  # largest level
    draw: Draw  # errors along a record
    variance: Callable[[float], float]  # R that a filter knows, at a level [deg^2]


def _white(samples: int, variance: float, rng: np.random.Generator) -> Array:
    noise: Array = np.sqrt(variance) * rng.standard_normal(samples)
    return noise


def with_memory(white: Array, seconds: float, sample_time: float) -> Array:
    """Return noise (N,) of the same variance whose correlation falls to 1/e in a time; zero: the same."""
    keep = np.exp(-sample_time / seconds) if seconds > 0 else 0.0
    noise = white.copy()
    for k in range(1, len(white)):
        noise[k] = keep * noise[k - 1] + np.sqrt(1 - keep**2) * white[k]
    return noise


def _drifting(level: float, bend_deg: Array, T: float, rng: np.random.Generator) -> Array:
    """Add a bias that walks: its standard deviation is `level` deg after a minute."""
    drift = np.cumsum(level * np.sqrt(T / 60) * rng.standard_normal(len(bend_deg)))
    return drift + _white(len(bend_deg), KNOWN_DEG2, rng)


def _correlated(level: float, bend_deg: Array, T: float, rng: np.random.Generator) -> Array:
    """Draw noise whose correlation falls to 1/e in `level` seconds: autoregressive, of first order."""
    return with_memory(_white(len(bend_deg), KNOWN_DEG2, rng), level, T)


def _mixed(level: float, bend_deg: Array, T: float, rng: np.random.Generator) -> Array:
    """Draw normal errors four times of five, else three times as large ones to one side; R = `level`."""
    samples = len(bend_deg)
    deviation = np.sqrt(level / (_SEEN_WELL + _SEEN_BADLY * _BADLY**2))
    badly = rng.uniform(size=samples) < _SEEN_BADLY
    normal = rng.standard_normal(samples)
    noise: Array = deviation * np.where(badly, _BADLY * np.abs(normal), normal)
    return noise


def _in_steps(level: float, bend_deg: Array, T: float, rng: np.random.Generator) -> Array:
    """Round what is measured to steps of `level` degrees."""
    measured = bend_deg + _white(len(bend_deg), FINE_DEG2, rng)
    if level > _FINEST_DEG:
        measured = level * np.rint(measured / level)
    error: Array = measured - bend_deg
    return error


def _with_gaps(level: float, bend_deg: Array, T: float, rng: np.random.Generator) -> Array:
    """Lose a share `level` of the time, in gaps of a second in the mean."""
    lost = _episodes(level, GAP_S, len(bend_deg), T, rng, fixed=False)
    return np.where(lost, np.nan, _white(len(bend_deg), KNOWN_DEG2, rng))


def _late(level: float, bend_deg: Array, T: float, rng: np.random.Generator) -> Array:
    """Measure the angle of `level` seconds ago."""
    time = np.arange(len(bend_deg)) * T
    before = np.interp(time - level, time, bend_deg)
    noise: Array = before - bend_deg + _white(len(bend_deg), KNOWN_DEG2, rng)
    return noise


def _stuck(level: float, bend_deg: Array, T: float, rng: np.random.Generator) -> Array:
    """Repeat the last value for two seconds, a share `level` of the time."""
    measured = bend_deg + _white(len(bend_deg), KNOWN_DEG2, rng)
    stuck = _episodes(level, STUCK_S, len(bend_deg), T, rng, fixed=True)
    stuck[0] = False
    last = np.maximum.accumulate(np.where(stuck, 0, np.arange(len(bend_deg))))
    error: Array = measured[last] - bend_deg
    return error


def _episodes(
    share: float, seconds: float, samples: int, T: float, rng: np.random.Generator, *, fixed: bool
) -> Hidden:
    """Return where something lasts: episodes of a length apart such that they take a share of the time."""
    inside = np.zeros(samples, dtype=bool)
    if share <= 0:
        return inside
    time = np.arange(samples) * T
    end, apart = 0.0, seconds * (1 - share) / share
    while end < time[-1]:
        begin = end + rng.exponential(apart)
        end = begin + (seconds if fixed else rng.exponential(seconds))
        inside |= (time >= begin) & (time < end)
    return inside


def _known(level: float) -> float:
    return KNOWN_DEG2


FAULTS = {
    "drifting-bias": SensorErrors("Drift, {:g} deg a minute", "deg in a minute", 1e3, _drifting, _known),
    "correlated": SensorErrors("Correlated over {:g} s", "s", 1e3, _correlated, _known),
    "mixture": SensorErrors("Mixture, R = {:g} deg²", "deg^2", 1e6, _mixed, float),
    "quantised": SensorErrors(
        "Steps of {:g} deg", "deg", 1e3, _in_steps, lambda level: FINE_DEG2 + level**2 / 12
    ),
    "drop-outs": SensorErrors("Gaps, {:g} of the time", "of the time", 0.95, _with_gaps, _known),
    "delayed": SensorErrors("Late by {:g} s", "s", 60.0, _late, _known),
    "stuck": SensorErrors("Stuck, {:g} of the time", "of the time", 0.95, _stuck, _known),
}
STEREO = "stereo-vision"  # its level is the number of instruments that pass in a minute


@dataclasses.dataclass(frozen=True)
class StereoNoise:
    """Measured errors of stereo sensors."""

    bends_deg: Array  # (n,) grid, increasing [deg]
    errors_deg: Array  # (rigs, n, repeats) errors of each rig [deg]
    hides_per_pass: float  # share of passes that hide a marker
    hidden_s: Array  # (m,) times for which they did [s]

    @property
    def variance(self) -> float:
        """Mean square error over grid and rigs [deg^2]: the R of a Kalman filter."""
        return float(np.mean(self.errors_deg**2))

    def draw(self, level: float, bend_deg: Array, sample_time: float, rng: np.random.Generator) -> Array:
        """Draw the errors of a record, as one of the rigs made them; NaN where a marker is hidden.

        The level is the number of passes per minute; beyond the grid, errors are those at its ends.
        """
        errors = self.errors_deg[rng.integers(len(self.errors_deg))]
        repeats = errors.shape[1]
        mean = errors.mean(axis=1)
        # The mean of few takes a part of their scatter.
        rest = (errors - mean[:, None]) * np.sqrt(repeats / (repeats - 1)) if repeats > 1 else errors * 0
        place = np.interp(bend_deg, self.bends_deg, np.arange(len(mean)))
        near = np.rint(place).astype(int)
        drawn = np.interp(place, np.arange(len(mean)), mean)
        drawn += rest[near, rng.integers(repeats, size=len(near))]
        return np.where(self._hidden(level, len(drawn), sample_time, rng), np.nan, drawn)

    def _hidden(self, level: float, samples: int, sample_time: float, rng: np.random.Generator) -> Hidden:
        seconds = samples * sample_time
        count = rng.poisson(level * self.hides_per_pass * seconds / 60)
        starts, lasting = rng.uniform(0, seconds, count), rng.choice(self.hidden_s, count)
        time = np.arange(samples) * sample_time
        hidden = np.zeros(samples, dtype=bool)
        for start, length in zip(starts, lasting, strict=True):
            hidden |= (time >= start) & (time < start + length)
        return hidden


@functools.cache
def stereo_noise() -> StereoNoise:
    """Return what was measured."""
    values = json.loads((assets_folder() / "stereo_noise.json").read_text())
    bends, errors, hidden = (np.array(values[key]) for key in ("bends_deg", "errors_deg", "hidden_s"))
    return StereoNoise(bends, errors, values["hides_per_pass"], hidden)
