"""Characteristic of a stereo sensor: errors on a grid of angles, and stretches hidden by instruments."""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.preset.preset import Preset
from twin.vision.rig import StereoRig
from twin.vision.sensor import StereoSensor, frame_samples

Array = NDArray[np.float64]

FURTHEST_DEG = 90.0
"""Largest bend of the grid [deg]."""
_TAPERS = (-0.5, 0.8)  # of the curvature, from the base (more) to the tip (less)
_SAMPLE_TIME, _SWEEP_SECONDS = 0.02, 24.0

Progress = Callable[[int, int], None]


@dataclasses.dataclass(frozen=True)
class Occluded:
    """Long episode during which instruments pass.

    Attributes:
        error_deg: (frames,) error of each pair of pictures; NaN where no angle is known [deg].
        hidden_s: (n,) time of each stretch without an angle [s].
        passes: number of passes.
    """

    error_deg: Array
    hidden_s: Array
    passes: int


def grid_errors(
    preset: Preset, rig: StereoRig, bends_deg: Array, repeats: int, on_progress: Progress | None = None
) -> Array:
    """Return errors of the angle at bends (n,) [deg] held still, (n, repeats); NaN where none is known [deg].

    Each repeat has another distribution of the curvature along the section.
    """
    rng = np.random.default_rng([rig.seed, 3])
    bends = np.repeat(np.asarray(bends_deg, dtype=float), repeats)
    record = _record(preset, np.arange(len(bends), dtype=np.float64), np.radians(bends), rng)
    still = dataclasses.replace(rig, frames_per_second=1.0, exposure_s=0.0, rolling_shutter_s=0.0)
    sensor = StereoSensor(preset, still)
    measured = sensor.measure(record, np.random.SeedSequence([rig.seed, 4]), on_progress)
    return np.degrees(measured - record.bend).reshape(-1, repeats)


def occluded(preset: Preset, rig: StereoRig, frames: int, on_progress: Progress | None = None) -> Occluded:
    """Measure a long episode that sweeps over all angles while instruments pass."""
    seconds = frames / rig.frames_per_second
    time = np.arange(round(seconds / _SAMPLE_TIME), dtype=np.float64) * _SAMPLE_TIME
    bend = np.radians(FURTHEST_DEG) * np.sin(2 * np.pi * time / _SWEEP_SECONDS)
    record = _record(preset, time, bend, np.random.default_rng([rig.seed, 5]), even=True)
    sensor, seed = StereoSensor(preset, rig), np.random.SeedSequence([rig.seed, 6])
    measured = sensor.measure(record, seed, on_progress)
    taken = frame_samples(time, rig.frames_per_second)
    error = np.degrees(measured - bend)[taken]
    missing = np.concatenate([[False], np.isnan(error), [False]])
    begins, ends = (np.flatnonzero(np.diff(missing.astype(int)) == step) for step in (1, -1))
    return Occluded(error, (ends - begins) / rig.frames_per_second, len(sensor.passes(record, seed)))


def _record(
    preset: Preset, time: Array, bend: Array, rng: np.random.Generator, *, even: bool = False
) -> Episode:
    """Return an episode of given poses, whose curvature tapers along the section."""
    count = len(time)
    taper = np.full(count, rng.uniform(*_TAPERS)) if even else rng.uniform(*_TAPERS, count)
    share = 1 + taper[:, None] * np.linspace(1, -1, preset.vertebrae)
    return Episode(
        time=time,
        pull=np.zeros(count),
        bend=bend,
        measured_bend=bend,
        joint_angle=bend[:, None] * share / share.sum(axis=1, keepdims=True),
        wire_tension=np.zeros((count, 2, 0)),
        sheath_friction=np.zeros((count, 2, 0)),
    )
