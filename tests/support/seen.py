"""Records that two cameras look at, without a simulation."""

import numpy as np
import pytest

from twin.episode import Episode
from twin.physics import choose_backend

needs_gl = pytest.mark.skipif(choose_backend() == "disable", reason="nothing here draws without a screen")


def record(
    bend_deg: np.ndarray,
    *,
    sample_time: float = 0.1,
    vertebrae: int = 16,
    lateral_deg: np.ndarray | None = None,
) -> Episode:
    """A record of bends, with a curvature that falls towards the tip."""
    bend, count = np.radians(bend_deg), len(bend_deg)
    share = 1 + 0.3 * np.linspace(1, -1, vertebrae)
    share /= share.sum()
    planes = {}
    if lateral_deg is not None:
        lateral = np.radians(lateral_deg)
        planes = {
            "lateral_pull": np.zeros(count),
            "lateral_bend": lateral,
            "lateral_joint_angle": lateral[:, None] * share,
        }
    wires = 4 if planes else 2
    return Episode(
        time=np.arange(count) * sample_time,
        pull=np.zeros(count),
        bend=bend,
        measured_bend=bend,
        joint_angle=bend[:, None] * share,
        wire_tension=np.zeros((count, wires, 0)),
        sheath_friction=np.zeros((count, wires, 0)),
        metadata={"preset": {"bending_planes": 2}} if planes else {},
        **planes,
    )
