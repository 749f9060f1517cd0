"""Bending sensor: sampling rate, noise, resolution, latency, hold between readings, plausible readings."""

import math

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.preset.preset import Preset

Array = NDArray[np.float64]

# Largest plausible magnitudes in logs and live streams: they find a broken packet or another unit.
LARGEST_BEND_DEG = 720.0  # two full turns [deg]
LARGEST_PULL_MM = 200.0  # ten times the stroke of a long section [mm]
LARGEST_TIME_S = 9.2e9  # nanoseconds since 1970 end there too [s]
_COINCIDENT = 1e-6  # tolerance of times, relative to the shortest sample time: sums of periods round


def samples_late(latency: float, sample_time: float) -> int:
    """Return how many samples late a reading arrives, by the latency and T [s], where every sample is read.

    One that is on its way at a sample is there at the next.
    """
    return math.ceil(latency / sample_time - _COINCIDENT)


def measure(preset: Preset, time: Array, bend: Array, rng: np.random.Generator) -> Array:
    """Return the sensor's reported angle at each sample (N,) [rad], from the true one.

    Reading j is of the bend at time[0] + j `sensor_period`, linear between samples (of sample j where the
    period is 0), times `sensor_scale`, plus `sensor_zero`. Gaussian noise of `sensor_noise` is added, the sum
    is rounded to `sensor_resolution`, arrives `sensor_latency` later and is reported until the next one
    arrives. Before the first arrival the sensor reports the reading of time[0]: the endoscope had rested
    there for long enough. One number is drawn for each reported reading, if there is noise. Without any
    parameter of the sensor, the angle is the true one, bit for bit.
    """
    if time.ndim != 1 or time.shape != bend.shape or not len(time):
        raise InputError(f"time {time.shape} and bend {bend.shape}: must be two arrays of one length (N,)")
    if not (np.diff(time) > 0).all():
        raise InputError("time must increase from sample to sample")
    instant, reported = _readings(preset, time)

    reading = np.interp(instant, time, bend)
    if preset.sensor_zero or preset.sensor_scale != 1:
        reading = preset.sensor_scale * reading + preset.sensor_zero
    if preset.sensor_noise:
        reading += preset.sensor_noise * rng.standard_normal(len(reading))
    if preset.sensor_resolution > np.spacing(np.abs(reading).max()):  # a finer step rounds nothing
        reading = preset.sensor_resolution * np.round(reading / preset.sensor_resolution)
    return reading[reported]


def _readings(preset: Preset, time: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the times (R,) of the reported readings, and the index of the reading at each sample (N,)."""
    rounding = 4 * float(np.spacing(np.abs(time).max()))
    tolerance = max(_COINCIDENT * float(np.diff(time).min(initial=1.0)), rounding)
    taken = time - preset.sensor_latency + tolerance  # what was taken by then has arrived at each sample
    if not preset.sensor_period:
        sample, reported = np.unique(
            np.maximum(np.searchsorted(time, taken, side="right") - 1, 0), return_inverse=True
        )
        return time[sample], reported

    period = max(preset.sensor_period, tolerance)  # shorter ones cannot be distinguished
    number, reported = np.unique(np.maximum(np.floor((taken - time[0]) / period), 0), return_inverse=True)
    instant = time[0] + number * period
    # An instant that coincides with a sample is moved exactly there, or rounding would leak into the reading.
    sample = time[np.minimum(np.searchsorted(time, instant - tolerance), len(time) - 1)]
    return np.where(np.abs(sample - instant) <= tolerance, sample, instant), reported


def smoothed(time: Array, reading: Array) -> Array:
    """Return readings (N,) without their noise; NaN where there is none.

    A cubic smoothing spline, as smooth as generalised cross-validation finds best (Craven and Wahba 1979).
    """
    from scipy.interpolate import make_smoothing_spline  # here: a live stream needs none

    known = np.isfinite(reading)
    if known.sum() < _FEWEST:
        return reading
    smooth = np.full_like(reading, np.nan)
    smooth[known] = make_smoothing_spline(time[known], reading[known])(time[known])
    return smooth


def smoothing_deviation(time: Array, reading: Array) -> float:
    """Return the standard deviation of `smoothed` readings (N,), by those of halves against the other half.

    Halves disagree by twice the deviation of all; beyond their noise, readings are off the other half by no
    less than the deviation, with what was smoothed too far. The larger counts. Zero for a short log.
    """
    known = np.flatnonzero(np.isfinite(reading))
    if len(known) < 2 * _FEWEST:
        return 0.0
    half, rest = known[::2], known[1::2]
    one, other = (smoothed(time[of], reading[of]) for of in (half, rest))
    predicted = np.interp(time[half], time[rest], other)
    beyond = float(np.mean((reading[half] - predicted) ** 2)) - estimated_variance(reading)
    return max(float(np.std(predicted - one)) / 2, math.sqrt(max(beyond, 0.0)))


_THIRD = np.array([1.0, -3.0, 3.0, -1.0])  # of a third difference, which no parabola has
_BLOCK = 20  # samples over which residuals are averaged
_MEDIAN = 0.9  # median of such a mean over the variance: 0.92 of normal noise, 0.86 of a skewed or heavy one
_FEWEST = 40  # samples from which a variance is estimated


def estimated_variance(reading: Array) -> float:
    """Estimate the variance of the noise in evenly sampled readings (N,), NaN where there is none.

    The path of the angle is smooth: its third difference is that of the noise (difference-based variance,
    Gasser, Sroka and Jennen-Steinmetz 1986). Means over blocks are taken, and of these the median: corners of
    the path are few. At least it is that of rounding, step^2 / 12. NaN with fewer than 40 readings.
    """
    known = reading[np.isfinite(reading)]
    if len(known) < _FEWEST:
        return math.nan
    square = np.convolve(reading, _THIRD, "valid") ** 2 / (_THIRD @ _THIRD)
    square = square[np.isfinite(square)]
    blocks = square[: len(square) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).mean(axis=1)
    if not len(blocks):
        return math.nan
    steps = np.diff(np.unique(known))
    return max(float(np.median(blocks)) / _MEDIAN, float(steps.min(initial=np.inf)) ** 2 / 12)
