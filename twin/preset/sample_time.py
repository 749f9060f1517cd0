"""Check that a sample time is a whole multiple of the control period."""

import numpy as np

from twin.errors import InputError
from twin.preset.preset import Preset


def check_sample_time(preset: Preset, sample_time: float) -> int:
    """Return the number of control periods between two samples.

    Raises:
        ValueError: not a whole number.
    """
    ratio = sample_time / preset.control_period
    periods = round(ratio) if np.isfinite(ratio) else 0
    if periods < 1 or abs(periods * preset.control_period - sample_time) > 1e-9:
        raise InputError(
            f"sample time {sample_time:g} s: must be a whole multiple of the control period, "
            f"{preset.control_period:g} s"
        )
    return periods
