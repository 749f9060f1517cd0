"""An episode to draw, and the size and samples of small pictures of it."""

import numpy as np
import pytest

from twin.episode import Episode
from twin.physics import headless

needs_gl = pytest.mark.skipif(headless.choose_backend() == "disable", reason=headless.HOW_TO_INSTALL)
VERTEBRAE = 16
SMALL = {"width": 320, "height": 180}
STRAIGHT, UP, DOWN = 0, 10, 30  # samples of the episode below


def make_episode(*, hinges: int = VERTEBRAE, amplitude_deg: float = 80) -> Episode:
    """A sine of pull, and a bend that follows it a little late, without simulation."""
    time = np.arange(41) * 0.1
    bend = np.radians(amplitude_deg) * np.sin(2 * np.pi * time / 4)
    return Episode(
        time=time,
        pull=2e-3 * np.sin(2 * np.pi * time / 4 + 0.4),
        bend=bend,
        measured_bend=bend,
        joint_angle=np.repeat(bend[:, None] / VERTEBRAE, VERTEBRAE, axis=1)[:, :hinges],
        wire_tension=np.zeros((41, 2, 1)),
        sheath_friction=np.zeros((41, 2, 0)),
    )
