"""Accuracy of the stereo sensor: over all angles, and while instruments pass before its cameras."""

import dataclasses
from collections.abc import Callable

import numpy as np

from twin.benchmark.result import Result
from twin.preset.preset import Preset

_STEP_DEG, _REPEATS = 1.0, 2
_PASSES_PER_MINUTE = 20.0
_MOST_RMSE_DEG, _MOST_BIAS_DEG, _MOST_ERROR_DEG = 0.3, 0.1, 2.0


def accuracy(preset: Preset, progress: Callable[[int, int], None]) -> dict[str, Result]:
    """Measure RMSE, bias and lost pairs of pictures over [-90, 90] deg, at the usual settings."""
    from twin.vision.characteristic import FURTHEST_DEG, grid_errors
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
    from twin.vision.characteristic import occluded
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
