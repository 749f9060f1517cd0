"""Measure the noise `stereo-vision` of the comparison on a grid: `python -m scripts.studies.measure_stereo`.

It is run when the stereo sensor changes, and writes `assets/stereo_noise.json`.
"""

import dataclasses
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scripts.command import Options, Summary, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress
from twin.episode import Episode
from twin.errors import require_extra
from twin.preset.preset import Preset
from twin.rendering.camera import frame_samples
from twin.vision.rig import StereoRig
from twin.vision.sensor import StereoSensor

Array = NDArray[np.float64]

FURTHEST_DEG = 90.0  # largest bend of the grid
_TAPERS = (-0.5, 0.8)  # of the curvature, from the base (more) to the tip (less)
_SAMPLE_TIME, _SWEEP_SECONDS = 0.02, 24.0

OnProgress = Callable[[int, int], None]


def grid_errors(
    preset: Preset, rig: StereoRig, bends_deg: Array, repeats: int, on_progress: OnProgress | None = None
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


def occluded(
    preset: Preset, rig: StereoRig, frames: int, on_progress: OnProgress | None = None
) -> tuple[Array, Array, int]:
    """Measure a long episode that sweeps over all angles while instruments pass.

    Returns the error of each pair of pictures, NaN where no angle is known [deg], the time of each stretch
    without an angle [s], and the number of passes.
    """
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
    return error, (ends - begins) / rig.frames_per_second, len(sensor.passes(record, seed))


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


@dataclasses.dataclass(frozen=True)
class MeasureStereo(Options):
    """Measure the errors of the stereo sensor over [-90, 90] deg, and for how long instruments hide it."""

    out: Path
    """File to write, a .json."""
    preset: str = "ureteroscope"
    """Endoscope in front of the cameras."""
    rigs: int = 6
    """Number of rigs, which differ in their tolerances and in their calibration."""
    step: float = 1.0
    """Of the grid [deg]."""
    repeats: int = 4
    """Pairs of pictures at each angle, each with another distribution of the curvature."""
    frames: int = 6000
    """Pairs of pictures while instruments pass."""
    seed: int = 0
    """Of the first rig."""


def measure_stereo(args: MeasureStereo) -> Summary:
    """Write the file."""
    require_extra("vision")
    from twin.files.atomic import write_whole
    from twin.preset.file import load_preset

    out = output_file(args.out, (".json",), '"hidden_s"')
    preset = load_preset(args.preset)
    bends = np.arange(-FURTHEST_DEG, FURTHEST_DEG + args.step / 2, args.step)
    errors = [
        grid_errors(
            preset, StereoRig(seed=args.seed + number), bends, args.repeats, Progress(f"rig {number}")
        )
        for number in range(args.rigs)
    ]
    rig = StereoRig(seed=args.seed, occlusions_per_minute=20.0)
    error, hidden_s, passes = occluded(preset, rig, args.frames, Progress("passes"))
    contents = {
        "rig": {name: value for name, value in dataclasses.asdict(StereoRig()).items() if name != "seed"},
        "preset": args.preset,
        "bends_deg": bends.tolist(),
        "errors_deg": np.round(errors, 4).tolist(),
        "hides_per_pass": round(len(hidden_s) / max(passes, 1), 4),
        "hidden_s": np.round(hidden_s, 3).tolist(),
    }
    write_whole(out, json.dumps(contents) + "\n")
    rmse = float(np.sqrt(np.nanmean(np.square(errors))))
    gaps = f"{passes} passes hid a marker {len(hidden_s)} times"
    largest = float(np.nanmax(np.abs(error)))
    line = f"{out}: RMSE {rmse:.3f} deg over {args.rigs} rigs; {gaps}, errors then within {largest:.2f} deg"
    return Summary(line, {"out": str(out), "rmse_deg": rmse, "lost": int(np.isnan(errors).sum())})


main = partial(run_verb, MeasureStereo, measure_stereo)

if __name__ == "__main__":
    sys.exit(main())
