"""Load-dependent friction against the capstan equation, alone and in the simulation; how it drifts."""

import numpy as np
import pytest
from both_twins import MUJOCO
from hypothesis import given
from hypothesis import strategies as st

from twin.mechanics.friction import element_friction, friction_per_tension, hinge_friction
from twin.preset.preset import Preset
from twin.signals.excitation import approach

SAMPLE_TIME = 0.02  # [s]
SLIDING = Preset(
    "sliding",
    vertebrae=8,
    section_stiffness=0.03,
    wire_offset=1.3e-3,
    joint_friction=0.0,
    wire_stiffness=1.5e4,
    pretension=2.0,
    sheath_elements=5,
    sheath_friction=0.2,
    sheath_bend=np.pi,
    sheath_friction_floor=0.0,
    time_step=2.5e-3,
    control_period=1e-2,
)
ROUGH = SLIDING.replace(joint_friction=5e-4, sheath_friction_floor=1.0)
THERE, BACK = np.linspace(0, 4e-3, 101), np.linspace(4e-3, 0.5e-3, 176)
PULLED, RELEASED = slice(70, 101), slice(-20, None)  # all elements slide one way


@given(
    elements=st.integers(1, 64),
    friction=st.floats(0, 1),
    bend=st.floats(0, 4 * np.pi),
    tension=st.floats(0.1, 100),
)
def test_elements_of_any_number_make_up_the_capstan_equation(elements, friction, bend, tension):
    share = np.arange(elements + 1) / elements
    sliding = tension * np.exp(-friction * bend * share)  # Euler: exact at every angle of wrap
    per_tension = friction_per_tension(friction, bend, elements)
    drop = element_friction(sliding, per_tension, 0.0)
    np.testing.assert_allclose(drop, -np.diff(sliding), rtol=1e-9, atol=1e-12 * tension)
    np.testing.assert_array_equal(element_friction(sliding[::-1], per_tension, 0.0), drop[::-1])
    slack = element_friction(0 * sliding, per_tension, 2.0 / elements)
    assert slack.sum() == pytest.approx(2.0)


@pytest.mark.parametrize("offset", [0.0, 0.8])
@pytest.mark.parametrize("bend", [0.0, 0.5, np.pi, 2 * np.pi])
def test_sliding_wire_obeys_the_capstan_equation_at_every_element(twin, bend, offset):
    preset = SLIDING.replace(sheath_bend=bend, sheath_bend_offset=offset)
    tension = twin.simulate(preset, np.concatenate([THERE, BACK]), SAMPLE_TIME).wire_tension[:, 0]
    pulled, released = tension[PULLED], tension[RELEASED]
    passed = (bend + offset) * np.arange(preset.sheath_elements + 1) / preset.sheath_elements
    left = np.exp(-preset.sheath_friction * passed)
    np.testing.assert_allclose(pulled / pulled[:, :1], np.tile(left, (len(pulled), 1)), rtol=0.001)
    np.testing.assert_allclose(released / released[:, :1], np.tile(1 / left, (len(released), 1)), rtol=0.004)


def test_bending_the_sheath_of_a_held_endoscope_moves_nothing_and_straightening_it_does(twin):
    """More friction holds what less friction held; less friction lets the section spring back."""
    pull = np.concatenate([THERE, np.full(100, 4e-3)])
    bends = []
    for end in (4.0, 0.0):
        sheath_bend = np.concatenate([np.full(151, 2.0), np.linspace(2.0, end, 50)])
        bends.append(twin.simulate(ROUGH, pull, SAMPLE_TIME, sheath_bend=sheath_bend).bend[150:])
    more, less = bends
    assert np.ptp(more) < 1e-4 * more[0]
    assert np.ptp(less) > 1e-2 * less[0]


def test_bend_converges_with_the_number_of_elements(twin):
    pull = np.concatenate([np.linspace(0, 3e-3, 100), np.linspace(3e-3, 1.5e-3, 50)])
    bends = [twin.simulate(ROUGH.replace(sheath_elements=n), pull, SAMPLE_TIME).bend for n in (1, 3, 12, 24)]
    off = [np.abs(bend - bends[-1]).max() / np.ptp(bends[-1]) for bend in bends[:-1]]
    assert (np.diff(off) < 0).all()
    assert off[-1] < 0.02


@given(
    turn=st.integers(1, 20).flatmap(lambda n: st.lists(st.floats(0, 0.3), min_size=n, max_size=n)),
    tension=st.floats(0.1, 50),
    seed=st.integers(0, 99),
)
def test_routing_friction_dissipates_what_the_capstan_equation_does_to_first_order(turn, tension, seed):
    """Power lost at guide i: (tension behind it less that before it) times the speed of the wire through it.

    Bending hinge j pulls wire through every guide nearer to the base, and half-way through its own.
    """
    friction, arm = 1e-6, 1.5e-3
    rate = np.random.default_rng(seed).uniform(0, 2, len(turn))  # [rad / s] of every hinge, all one way
    power, behind = 0.0, tension
    for guide in reversed(range(len(turn))):  # from the tip, where the tension is known
        before = behind * np.exp(friction * turn[guide])
        speed = arm * (rate[guide + 1 :].sum() + rate[guide] / 2)
        power += (before - behind) * speed
        behind = before
    own = np.full(len(turn), 3e-4)
    torque = hinge_friction(own, friction * arm, np.array(tension), np.array(turn))
    assert (torque - own) @ rate == pytest.approx(power, rel=1e-4, abs=1e-17)
    np.testing.assert_array_equal(hinge_friction(own, 0.0, np.array(tension), np.array(turn)), own)


@pytest.mark.parametrize(
    "drift",
    [{"friction_warm_up": 0.8, "warm_up_time": 1.5}, {"friction_wear": 50.0}, {"friction_warm_up": -0.5}],
    ids=["warm-up", "wear", "cold and smooth"],
)
def test_friction_in_the_simulation_follows_its_drift(twin, drift):
    preset = ROUGH.replace(**drift, sheath_bend=2.0)
    # So slow that no control period is divided.
    pull = 1e-4 * (1 - np.cos(2 * np.pi * np.arange(2000) / 1000))
    period = preset.control_period
    episode = twin.simulate(preset, pull, period)
    # MuJoCo's is of tension and drift at the start of the period that leads to the sample, the other's of the
    # sample itself.
    late = 1 if twin is MUJOCO else 0
    time = (len(approach(0.0, period)) + np.arange(len(pull) - 1)) * period
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(pull)))])[:-1]
    factor = 1 + preset.friction_wear * travel
    factor += preset.friction_warm_up * np.exp(-time / preset.warm_up_time)
    assert np.ptp(factor) > 0.01
    for k in range(len(pull) - 1):
        per_tension = friction_per_tension(preset.sheath_friction * factor[k], 2.0, preset.sheath_elements)
        floor = preset.sheath_friction_floor * factor[k] / preset.sheath_elements
        expected = element_friction(episode.wire_tension[k], per_tension, floor)
        np.testing.assert_allclose(episode.sheath_friction[k + late], expected, rtol=1e-9)
