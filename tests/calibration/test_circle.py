"""Roundness of the tip's path: without friction and slack it is a circle, with slack wires it is not."""

import numpy as np
from plain_endoscope import PLAIN

from twin.calibration.circle import out_of_round

TAUT = PLAIN.replace(pretension=60.0, sheath_friction=0.0, sheath_friction_floor=1.0)


def test_taut_wires_bring_a_circle_and_slack_ones_do_not():
    slack = TAUT.replace(pretension=0.5)
    shares = out_of_round([TAUT.without_friction(), TAUT, slack], [1e-3, 2e-3])
    assert (shares[0] < 1e-3).all()
    assert (shares[1] < 0.02).all()
    assert shares[2, 1] > 0.03


def test_second_plane_is_like_the_first():
    """A second plane of the preset's own makes no difference."""
    bent = TAUT.without_friction().replace(initial_bend=0.05, lateral_initial_bend=-0.3)
    alike = TAUT.without_friction().replace(initial_bend=0.05, lateral_initial_bend=0.05)
    np.testing.assert_array_equal(out_of_round([bent], [2e-3]), out_of_round([alike], [2e-3]))
