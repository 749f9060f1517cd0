"""A simulated record: it repeats and continues bit for bit, begins on a real path, and mistakes are told."""

import numpy as np
import pytest
from driven_endoscope import PRESET, SAMPLE_TIME, sine

from twin.physics import Endoscope, simulate
from twin.signals.excitation import approach


@pytest.fixture(scope="module")
def whole_run():
    command = sine(8.0, 2)
    endoscope = Endoscope.from_preset(PRESET)
    return command, simulate(PRESET, command, SAMPLE_TIME, endoscope=endoscope), endoscope


def test_two_runs_are_identical(whole_run):
    command, whole, _ = whole_run
    again = simulate(PRESET, command, SAMPLE_TIME)
    assert np.array_equal(again.bend, whole.bend)
    assert np.array_equal(again.wire_tension, whole.wire_tension)


@pytest.mark.parametrize("sample", [37, 330, 500])
def test_state_restored_into_a_fresh_endoscope_continues_bit_for_bit(whole_run, sample):
    command, whole, at_end = whole_run
    first = Endoscope.from_preset(PRESET)
    simulate(PRESET, command[: sample + 1], SAMPLE_TIME, endoscope=first)
    fresh = Endoscope.from_preset(PRESET)
    rest = simulate(PRESET, command[sample:], SAMPLE_TIME, state=first.save_state(), endoscope=fresh)
    for field in ("bend", "joint_angle", "wire_tension", "wire_slack", "sheath_friction"):
        assert np.array_equal(getattr(rest, field), getattr(whole, field)[sample:]), field
    assert np.array_equal(fresh.data.ptr.qpos, at_end.data.ptr.qpos)
    assert np.array_equal(fresh.data.ptr.qvel, at_end.data.ptr.qvel)


@pytest.mark.parametrize("other", [{"vertebrae": 8}, {"sheath_elements": 3}])
def test_state_of_another_endoscope_is_refused(other):
    state = Endoscope.from_preset(PRESET.replace(**other)).save_state()
    with pytest.raises(ValueError, match="does not fit"):
        Endoscope.from_preset(PRESET).restore_state(state)


def test_record_inside_the_stroke_starts_at_the_end_of_a_real_path():
    by_hand = Endoscope.from_preset(PRESET)
    for target in approach(3e-3, PRESET.control_period):
        by_hand.advance(target)
    record = simulate(PRESET, 3e-3 + 1e-3 * np.sin(np.arange(10) * 0.05), SAMPLE_TIME)
    assert record.bend[0] == by_hand.bend()
    assert np.array_equal(record.wire_tension[0], by_hand.wire_tension())
    assert np.array_equal(record.wire_slack[0], by_hand.wire_slack())


def test_unusable_commands_are_refused_in_one_line():
    with pytest.raises(ValueError, match="nan at sample 2") as refused:
        simulate(PRESET, np.array([0, 1e-3, np.nan]), SAMPLE_TIME)
    assert "\n" not in str(refused.value)
    for sample_time in (0.015, 0.005):
        with pytest.raises(ValueError, match="whole multiple of the control period"):
            simulate(PRESET, np.zeros(3), sample_time)
    with pytest.raises(ValueError, match="finite"):
        Endoscope.from_preset(PRESET).advance(np.inf)
