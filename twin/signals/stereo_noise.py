"""Noise of the stereo sensor: errors that it made on a grid of angles, and gaps where instruments hid it.

`assets/stereo_noise.json` is measured by `python -m scripts.studies.measure_stereo`. An error depends more on
the angle than on noise: as the endoscope moves slowly, errors of neighbouring samples are alike.
"""

import dataclasses
import functools
import json

import numpy as np
from numpy.typing import NDArray

from twin.files.assets import assets_folder

Array = NDArray[np.float64]

STEREO = "stereo-vision"
"""Name of the noise; its level is the number of instruments that pass in a minute."""


@dataclasses.dataclass(frozen=True)
class StereoNoise:
    """Measured errors of stereo sensors.

    Attributes:
        bends_deg: (n,) grid, increasing [deg].
        errors_deg: (rigs, n, repeats) errors of each rig [deg].
        hides_per_pass: share of passes that hide a marker.
        hidden_s: (m,) times for which they did [s].
    """

    bends_deg: Array
    errors_deg: Array
    hides_per_pass: float
    hidden_s: Array

    @property
    def variance(self) -> float:
        """Mean square error over grid and rigs [deg^2]: the R of a Kalman filter."""
        return float(np.mean(self.errors_deg**2))

    def draw(self, level: float, bend_deg: Array, sample_time: float, rng: np.random.Generator) -> Array:
        """Draw the errors of a record, as one of the rigs made them; NaN where a marker is hidden.

        Args:
            level: passes per minute.
            bend_deg: (N,) true angle [deg]; beyond the grid the errors are those at its ends.
            sample_time: time between two samples [s].
            rng: source of random numbers.
        """
        errors = self.errors_deg[rng.integers(len(self.errors_deg))]
        repeats = errors.shape[1]
        mean = errors.mean(axis=1)
        # The mean of few takes a part of their scatter.
        rest = (errors - mean[:, None]) * np.sqrt(repeats / (repeats - 1)) if repeats > 1 else errors * 0
        place = np.interp(bend_deg, self.bends_deg, np.arange(len(mean)))
        near = np.rint(place).astype(int)
        drawn = (
            np.interp(place, np.arange(len(mean)), mean) + rest[near, rng.integers(repeats, size=len(near))]
        )
        return np.where(self._hidden(level, len(drawn), sample_time, rng), np.nan, drawn)

    def _hidden(
        self, level: float, samples: int, sample_time: float, rng: np.random.Generator
    ) -> NDArray[np.bool_]:
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
