"""The farthest pull bends a section by two turns where nothing rubs."""

import numpy as np
import pytest
from small_dataset import SMALL, changed

from twin import simulate
from twin.dataset.recipe import farthest_pull

SMOOTH = SMALL.replace(
    sheath_friction=0.0, sheath_friction_floor=0.0, joint_friction=0.0, wire_stiffening=0.01, initial_bend=0.0
)
HALF_TURN = np.sin(np.pi / 2 * np.minimum(np.arange(300) * 0.02 / 4, 1))


@pytest.mark.parametrize(
    "preset", [SMOOTH, SMOOTH.replace(section_stiffness=0.02, section_stiffening=0.002, pretension=10.0)]
)
def test_farthest_pull_bends_by_two_turns_without_friction(preset):
    record = simulate(preset, farthest_pull(preset) * HALF_TURN, 0.02)
    assert record.truth_deg[-1] == pytest.approx(720, rel=5e-3)


def test_friction_only_lessens_the_bend():
    record = simulate(SMALL, farthest_pull(SMALL) * HALF_TURN, 0.02)
    assert 360 < record.truth_deg[-1] < 720


def test_a_stroke_beyond_one_turn_of_the_wire_is_simulated_and_a_wrong_unit_refused():
    turn = 2e3 * np.pi * SMALL.wire_offset
    changed(strokes_mm=((-2 * turn, 2 * turn),)).check()
    changed(strokes_mm=((0.0, 0.999e3 * farthest_pull(SMALL)),)).check()
    with pytest.raises(ValueError, match=r"this endoscope is pulled by at most .* mm: is the unit right"):
        changed(strokes_mm=((0.0, 1.001e3 * farthest_pull(SMALL)),)).check()


def test_no_endoscope_is_pulled_farther_than_a_log_may_be():
    assert farthest_pull(SMALL.replace(section_stiffness=1e3)) == pytest.approx(0.2)
