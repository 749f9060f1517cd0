"""Measured effects: friction that grows with the bend, slack wires, zero and delay of the command."""

import numpy as np
import pytest

from twin.mechanics.friction import friction_floor
from twin.preset.preset import Preset
from twin.reduced import ReducedTwins

T = 0.05
PRESET = Preset(
    "measured",
    vertebrae=6,
    section_stiffness=0.03,
    joint_friction=1e-3,
    wire_offset=2e-3,
    wire_stiffness=6e3,
    pretension=5.0,
    sheath_elements=3,
    sheath_friction=0.0,
    sheath_bend=1.0,
    sheath_friction_floor=0.5,
)
TIME = np.arange(0, 16, T)
PULL = 2e-3 * np.sin(2 * np.pi * TIME / 8) * (1 - np.exp(-TIME / 2))


def test_growing_friction_is_that_of_a_preset_whose_floor_is_as_high(twin):
    """At one bend of the sheath only the sum shows."""
    grown = PRESET.replace(sheath_friction_growth=1.2, sheath_friction_exponent=0.7, sheath_bend=2.0)
    equal = PRESET.replace(sheath_friction_floor=0.5 + 1.2 * 2.0**0.7, sheath_bend=2.0)
    one, other = (twin.simulate(preset, PULL, T) for preset in (grown, equal))
    np.testing.assert_allclose(one.bend, other.bend, atol=1e-7)
    np.testing.assert_allclose(one.sheath_friction, other.sheath_friction, atol=1e-9)
    assert one.sheath_friction.sum(axis=2) == pytest.approx(float(friction_floor(0.5, 1.2, 0.7, 2.0)))


def test_friction_follows_a_sheath_that_is_bent_on(twin):
    preset = PRESET.replace(sheath_friction_growth=0.8, sheath_friction_exponent=0.5)
    bend = np.linspace(0.0, 4.0, len(PULL))
    episode = twin.simulate(preset, PULL, T, sheath_bend=bend)
    friction = episode.sheath_friction[:, 0].sum(axis=1)
    np.testing.assert_allclose(friction[5:], 0.5 + 0.8 * bend[5:] ** 0.5, atol=0.01)


def test_slack_wires_leave_a_plateau_as_wide_as_both_slacks(twin):
    """Neither wire is taut while the pull is within the slack; beyond it one bends the section at once."""
    smooth = PRESET.replace(wire_slack=6e-4).without_friction()
    way = np.concatenate([np.linspace(0, 2e-3, 201), np.linspace(2e-3, -2e-3, 401)])
    episode = twin.simulate(smooth, way, T)
    still = np.abs(episode.bend) < np.radians(0.05)
    assert np.ptp(way[201:][still[201:]]) == pytest.approx(12e-4, abs=5e-5)
    assert episode.tension[0].tolist() == [0.0, 0.0]
    inside = np.abs(way) < 5.9e-4
    assert episode.tension[inside].max() < 0.01


def test_zero_of_the_command_shifts_the_record_and_nothing_else(twin):
    plain = twin.simulate(PRESET, PULL, T)
    shifted = twin.simulate(PRESET.replace(command_zero=7e-4), PULL + 7e-4, T)
    np.testing.assert_allclose(shifted.bend, plain.bend, atol=1e-9)
    np.testing.assert_allclose(shifted.pulley, plain.pulley, atol=1e-12)
    np.testing.assert_allclose(shifted.pull, plain.pull + 7e-4, atol=1e-15)


@pytest.mark.parametrize("samples", [1, 3])
def test_delayed_record_is_the_record_a_delay_later(twin, samples):
    way = np.concatenate([np.zeros(10), PULL])
    plain = twin.simulate(PRESET, way, T)
    late = twin.simulate(PRESET.replace(command_delay=samples * T), way, T)
    np.testing.assert_allclose(late.bend[samples:], plain.bend[:-samples], atol=np.radians(0.02))
    assert np.ptp(late.bend - plain.bend) > np.radians(1)


def test_twins_of_different_delays_step_together_as_each_alone():
    presets = [PRESET.replace(command_delay=delay) for delay in (0.0, 0.05, 0.21)]
    together, alone = ReducedTwins(presets, T), [ReducedTwins([preset], T) for preset in presets]
    for pull in PULL[:100].tolist():
        bends = together.step(pull)
        np.testing.assert_array_equal(bends, [one.step(pull)[0] for one in alone])


@pytest.mark.parametrize("planes", [1, 2])
def test_wire_alone_bends_to_its_side_and_the_section_comes_back_by_itself(twin, planes):
    """Paid out beyond neutral it is slack at the pulley; friction of hinges and sheath holds the section."""
    preset = PRESET.replace(wires_per_plane=1, bending_planes=planes)
    way = np.concatenate([np.linspace(0, 2e-3, 100), np.linspace(2e-3, -2e-3, 200)])
    episode = twin.simulate(preset, way, T)
    assert episode.bend[99] > np.radians(20)
    assert (episode.tension[:, 1] == 0).all()
    assert (episode.tension[:1, 0] == 0).all()
    assert episode.tension[99, 0] > 1
    assert episode.tension[-1, 0] == 0
    held = preset.joint_friction + preset.wire_offset * preset.sheath_friction_floor
    assert episode.bend[-1] * preset.section_stiffness == pytest.approx(held, rel=0.05)
    assert np.ptp(episode.bend[-40:]) < np.radians(0.01)
