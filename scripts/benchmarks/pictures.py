"""Speed of drawing without a screen: pictures of every camera, and frames of a film with its loop."""

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from scripts.benchmarks.harness import SAMPLE_TIME, OnProgress, Result, measurement, sinusoid
from twin.preset.preset import Preset
from twin.rendering.look import CAMERAS, Look
from twin.rendering.overlay import Overlay
from twin.rendering.render import Film
from twin.simulation import simulate

_SIZE = (640, 480)
_FRAMES, _REPEATS = 60, 3


@measurement("rendering")
def pictures(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure pictures per second of each camera, and frames of a film with its loop."""
    overlays = [Overlay(simulate(preset, sinusoid(amplitude, 8.0, 1), SAMPLE_TIME, physics="reduced"))]
    looks = {
        f"pictures of the camera `{camera}`": Look(camera=camera, panels="view", size=_SIZE)
        for camera in CAMERAS
    }
    looks["frames of a film with its loop"] = Look(size=_SIZE)
    results = {}
    for (name, look), key in zip(looks.items(), [*(f"pictures_{of}" for of in CAMERAS), "film"], strict=True):
        rate = _frames_per_second(Film(overlays, look, speed=1.0).frame, len(overlays[0].episode.time))
        bar = ">= 15" if key == "film" else ">= 30"
        results[key] = Result(f"{name}, 640 x 480", rate, "per second", bar)
    return results


def _frames_per_second(draw: Callable[[int], object], samples: int) -> float:
    """Return the best rate of some runs: what other programs take from this one is not its own."""
    draw(0)
    rates = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        for frame in range(_FRAMES):
            draw(frame * (samples - 1) // _FRAMES)
        rates.append(_FRAMES / (time.perf_counter() - start))
    return max(rates)


@measurement("stereo")
def accuracy(preset: Preset, progress: OnProgress) -> dict[str, Result]:
    """Measure RMSE, bias and lost pairs of pictures over [-90, 90] deg, at the usual settings."""
    from scripts.studies.measure_stereo import FURTHEST_DEG, grid_errors
    from twin.vision.rig import StereoRig

    bends = np.arange(-FURTHEST_DEG, FURTHEST_DEG + 0.5, 1.0)
    error = grid_errors(preset, StereoRig(), bends, 2, progress)
    rmse, bias = float(np.sqrt(np.nanmean(error**2))), float(abs(np.nanmean(error)))
    lost = int(np.isnan(error).sum())
    over = "of the stereo sensor over [-90, 90] deg"
    return {
        "stereo_rmse": Result(f"RMSE {over}", rmse, "deg", "<= 0.3"),
        "stereo_bias": Result(f"bias {over}", bias, "deg", "<= 0.1"),
        "stereo_lost": Result(f"pairs of {error.size} lost {over}", lost, "pairs", "none", lost == 0),
    }


@measurement("stereo_occlusions")
def occlusions(preset: Preset, frames: int, progress: OnProgress) -> dict[str, Result]:
    """Measure the largest error that is not flagged while instruments pass, and the share missing."""
    from scripts.studies.measure_stereo import occluded
    from twin.vision.rig import StereoRig

    rig = dataclasses.replace(StereoRig(), occlusions_per_minute=20.0)
    seen = occluded(preset, rig, frames, progress)
    largest, missing = float(np.nanmax(np.abs(seen.error_deg))), float(np.isnan(seen.error_deg).mean())
    during = f"while instruments pass, {frames} pairs of pictures"
    return {
        "stereo_largest": Result(f"largest error {during}", largest, "deg", "<= 2"),
        "stereo_missing": Result(f"missing {during}", 100 * missing, "%", "> 0: markers are hidden"),
    }
