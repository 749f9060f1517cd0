"""A simulated record: it repeats and continues bit for bit, starts on a real path, mistakes are refused."""

import numpy as np
import pytest
from both_twins import MUJOCO
from driven_endoscope import PRESET, SAMPLE_TIME

from twin.signals.excitation import approach


def test_record_inside_the_stroke_starts_at_the_end_of_a_real_path(twin):
    by_hand = twin.endoscope.from_preset(PRESET)
    for target in approach(3e-3, PRESET.control_period):
        by_hand.advance(target)
    record = twin.simulate(PRESET, 3e-3 + 1e-3 * np.sin(np.arange(10) * 0.05), SAMPLE_TIME)
    # The reduced twin goes there in steps as long as a sample.
    within = {"atol": 0.0 if twin is MUJOCO else 1e-6, "rtol": 0.0 if twin is MUJOCO else 1e-4}
    np.testing.assert_allclose(record.bend[0], by_hand.bend(), **within)
    np.testing.assert_allclose(record.wire_tension[0], by_hand.wire_tension(), **within)
    np.testing.assert_allclose(record.wire_slack[0], by_hand.wire_slack(), **within)


def test_unusable_commands_are_refused_in_one_line(twin):
    with pytest.raises(ValueError, match="nan at sample 2") as refused:
        twin.simulate(PRESET, np.array([0, 1e-3, np.nan]), SAMPLE_TIME)
    assert "\n" not in str(refused.value)
    for sample_time in (0.015, 0.005):
        with pytest.raises(ValueError, match="whole multiple of the control period"):
            twin.simulate(PRESET, np.zeros(3), sample_time)
    with pytest.raises(ValueError, match="finite"):
        twin.endoscope.from_preset(PRESET).advance(np.inf)
