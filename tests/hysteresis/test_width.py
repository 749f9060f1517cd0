"""Width of the loops of a log: that of a known loop, and none where there is none."""

import numpy as np
import pytest

from twin.hysteresis import ColemanHodgdon, PrandtlIshlinskii
from twin.hysteresis.width import WITHOUT, hysteresis_share, without_hysteresis

TIME = np.arange(0, 60, 0.02)
PULL = 3 * np.sin(2 * np.pi * TIME / 10)


@pytest.mark.parametrize("sign", [1, -1])
def test_width_of_a_play_is_its_own(sign):
    """A play of half width r and weight w falls 2 r w above where it rises, but for its ends."""
    bend = sign * PrandtlIshlinskii((1.0, 9.0), (0.4, 0.0)).response(PULL, 0.0)[len(TIME) // 6 :]
    share, deviation = hysteresis_share(PULL[len(TIME) // 6 :], bend)
    assert share * np.ptp(bend) == pytest.approx(0.8, rel=0.15)
    assert share > 2 * deviation


@pytest.mark.parametrize("scale", [0.1, 1.0])
def test_a_log_that_was_steered_by_its_angle_shows_none(scale):
    rng = np.random.default_rng(1)
    noise = 0.3 * scale * rng.standard_normal(len(TIME))
    steered = ("steered", PULL, 10 * PULL + noise)
    real = ("real", PULL, ColemanHodgdon(0.5, 10.0, 7.0).response(PULL, 0.0) + noise)
    assert without_hysteresis([steered, real]) == [f"steered {WITHOUT}"]


def test_a_log_in_one_direction_alone_says_nothing():
    assert not without_hysteresis([("ramp", TIME, 3 * TIME), ("still", 0 * TIME, TIME)])
