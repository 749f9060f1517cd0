"""Release of a curved section: from straight, as it is built, to where friction holds it.

What a section does that is let go at once depends on its inertia. MuJoCo's is chosen for its time step and is
not that of an endoscope. So the curve of its springs is brought in slowly, before the run begins.
"""

import math

import numpy as np

from twin.preset.preset import Preset

RELEASE_TIME = 1.0
"""Time over which the curve is brought in [s]."""
SETTLING_TIME = 0.2
"""Time that it is held after that [s]."""


def is_curved(preset: Preset) -> bool:
    """Return whether the section is curved where nothing pulls it."""
    return any(preset.initial_bends)


def release_shares(preset: Preset) -> list[float]:
    """Return the share of its curve that a section has in each control period of its release."""
    rising = math.ceil(RELEASE_TIME / preset.control_period)
    held = math.ceil(SETTLING_TIME / preset.control_period)
    shares: list[float] = np.concatenate([np.arange(1, rising + 1) / rising, np.ones(held)]).tolist()
    return shares
