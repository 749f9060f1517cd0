"""The saved state: a run that is put back into it continues as if nothing had happened, bit for bit."""

import dataclasses

import numpy as np
import pytest
from both_twins import Twin, same_state
from plain_endoscope import PLAIN

from twin.episode import Episode
from twin.preset.preset import Preset

SAMPLE_TIME = 0.02  # [s]
DRIVEN = PLAIN.replace(
    name="driven",
    backlash=3e-4,
    servo_gain=8.0,
    servo_speed=0.02,
    servo_acceleration=0.2,
    encoder_counts=2000,
)
WEARING = PLAIN.replace(name="wearing", friction_warm_up=0.8, warm_up_time=2.0, friction_wear=100.0)
EVERYTHING = DRIVEN.replace(
    name="everything",
    bending_planes=2,
    friction_warm_up=0.8,
    warm_up_time=2.0,
    friction_wear=100.0,
    routing_friction=0.2,
    wire_stiffening=0.05,
    initial_bend=0.2,
    gravity_z=-9.81,
)
PRESETS = [PLAIN, DRIVEN, WEARING, EVERYTHING]
COUNT = 60
PULL = 3e-3 * np.sin(2 * np.pi * np.arange(COUNT) / 40)
SHEATH_BEND = np.linspace(0.5, 4.0, COUNT)


def run(twin: Twin, preset: Preset, endoscope, samples: slice, state=None) -> Episode:
    lateral_pull = -0.7 * PULL[samples] if preset.bending_planes == 2 else None
    return twin.simulate(
        preset,
        PULL[samples],
        SAMPLE_TIME,
        lateral_pull=lateral_pull,
        sheath_bend=SHEATH_BEND[samples],
        state=state,
        endoscope=endoscope,
    )


def assert_continues(rest: Episode, whole: Episode, start: int) -> None:
    for field in dataclasses.fields(Episode):
        values = getattr(rest, field.name)
        if isinstance(values, np.ndarray) and field.name != "time":
            assert np.array_equal(values, getattr(whole, field.name)[start:]), field.name


@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.name)
@pytest.mark.parametrize("sample", [7, 33])
def test_state_restored_into_a_fresh_endoscope_continues_bit_for_bit(twin, preset, sample):
    preset = twin.able(preset)
    at_end, first, fresh = (twin.endoscope.from_preset(preset) for _ in range(3))
    whole = run(twin, preset, at_end, slice(None))
    run(twin, preset, first, slice(sample + 1))
    rest = run(twin, preset, fresh, slice(sample, None), first.save_state())
    assert_continues(rest, whole, sample)
    assert same_state(fresh.save_state(), at_end.save_state())
    assert np.array_equal(fresh.sheath_friction(), at_end.sheath_friction())


@pytest.mark.parametrize("other", [{"vertebrae": 8}, {"sheath_elements": 2}, {"bending_planes": 2}])
def test_state_of_another_endoscope_is_refused(twin, other):
    state = twin.endoscope.from_preset(PLAIN.replace(**other)).save_state()
    with pytest.raises(ValueError, match="does not fit this endoscope") as refused:
        twin.endoscope.from_preset(PLAIN).restore_state(state)
    assert "\n" not in str(refused.value)


def test_reset_is_as_new_with_drive_and_wear(twin):
    preset = Preset("worn", vertebrae=4, sheath_elements=2, backlash=1e-4, friction_wear=5.0)
    used, new = twin.endoscope.from_preset(preset), twin.endoscope.from_preset(preset)
    for pull in np.linspace(0, 3e-3, 60):
        used.advance(float(pull), sheath_bend=1.0)
    used.reset()
    for pull in np.linspace(0, 2e-3, 40):
        for endoscope in (used, new):
            endoscope.advance(float(pull))
    assert used.bend() == new.bend()
    assert np.array_equal(used.sheath_friction(), new.sheath_friction())


def test_restored_endoscope_runs_on_after_a_divergence(twin):
    endoscope = twin.endoscope.from_preset(Preset("brave", vertebrae=4, sheath_elements=2))
    before = endoscope.save_state()
    with pytest.raises(FloatingPointError, match=r"diverged|found no equilibrium"):
        endoscope.advance(1e9)
    endoscope.restore_state(before)
    endoscope.advance(1e-5)
