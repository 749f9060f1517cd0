"""Speed of drawing without a screen: pictures of every camera, and frames of a film with its loop."""

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from scripts.benchmarks.harness import SAMPLE_TIME, Result, sinusoid
from twin.preset.preset import Preset
from twin.rendering.film import Film
from twin.rendering.look import CAMERAS, Look
from twin.rendering.overlay import Overlay
from twin.simulation import simulate

_SIZE = (640, 480)
_FRAMES, _REPEATS = 60, 3
_PICTURES_PER_SECOND, _FRAMES_PER_SECOND = 30.0, 15.0


def pictures(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure pictures per second of each camera, and frames of a film with its loop."""
    episode = simulate(preset, sinusoid(amplitude, 8.0, 1), SAMPLE_TIME, physics="reduced")
    results = {}
    for camera in CAMERAS:
        film = Film([Overlay(episode)], Look(camera=camera, panels="view", size=_SIZE))
        rate = _frames_per_second(film.frame, len(episode.time))
        results[f"pictures_{camera}"] = _result(
            f"pictures of the camera `{camera}`", rate, _PICTURES_PER_SECOND
        )
    film = Film([Overlay(episode)], Look(size=_SIZE), speed=1.0)
    rate = _frames_per_second(film.frame, len(episode.time))
    results["film"] = _result("frames of a film with its loop", rate, _FRAMES_PER_SECOND)
    return results


def _result(name: str, rate: float, least: float) -> Result:
    return Result(f"{name}, 640 x 480", rate, "per second", f">= {least:g}", rate >= least)


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


_STEP_DEG, _REPEATS = 1.0, 2
_PASSES_PER_MINUTE = 20.0
_MOST_RMSE_DEG, _MOST_BIAS_DEG, _MOST_ERROR_DEG = 0.3, 0.1, 2.0


def accuracy(preset: Preset, progress: Callable[[int, int], None]) -> dict[str, Result]:
    """Measure RMSE, bias and lost pairs of pictures over [-90, 90] deg, at the usual settings."""
    from scripts.studies.measure_stereo import FURTHEST_DEG, grid_errors
    from twin.vision.rig import StereoRig

    bends = np.arange(-FURTHEST_DEG, FURTHEST_DEG + _STEP_DEG / 2, _STEP_DEG)
    error = grid_errors(preset, StereoRig(), bends, _REPEATS, progress)
    rmse, bias = float(np.sqrt(np.nanmean(error**2))), float(abs(np.nanmean(error)))
    lost = int(np.isnan(error).sum())
    over = "of the stereo sensor over [-90, 90] deg"
    return {
        "stereo_rmse": Result(f"RMSE {over}", rmse, "deg", f"<= {_MOST_RMSE_DEG:g}", rmse <= _MOST_RMSE_DEG),
        "stereo_bias": Result(f"bias {over}", bias, "deg", f"<= {_MOST_BIAS_DEG:g}", bias <= _MOST_BIAS_DEG),
        "stereo_lost": Result(f"pairs of {error.size} lost {over}", lost, "pairs", "none", lost == 0),
    }


def occlusions(preset: Preset, frames: int, progress: Callable[[int, int], None]) -> dict[str, Result]:
    """Measure the largest error that is not flagged while instruments pass, and the share missing."""
    from scripts.studies.measure_stereo import occluded
    from twin.vision.rig import StereoRig

    rig = dataclasses.replace(StereoRig(), occlusions_per_minute=_PASSES_PER_MINUTE)
    seen = occluded(preset, rig, frames, progress)
    largest, missing = float(np.nanmax(np.abs(seen.error_deg))), float(np.isnan(seen.error_deg).mean())
    during = f"while instruments pass, {frames} pairs of pictures"
    return {
        "stereo_largest": Result(
            f"largest error {during}", largest, "deg", f"<= {_MOST_ERROR_DEG:g}", largest <= _MOST_ERROR_DEG
        ),
        "stereo_missing": Result(
            f"missing {during}", 100 * missing, "%", "> 0: markers are hidden", missing > 0
        ),
    }
