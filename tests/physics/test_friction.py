"""Load-dependent friction against the capstan equation, alone and in the simulation; how it drifts."""

import numpy as np
import pytest
from both_twins import MUJOCO
from hypothesis import given
from hypothesis import strategies as st

from twin.mechanics.friction import element_friction, friction_per_tension, hinge_friction, hinge_groups
from twin.physics import Endoscope, simulate
from twin.physics.batch import EndoscopeBatch
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


def test_friction_of_many_endoscopes_is_that_of_each():
    rng = np.random.default_rng(0)
    count = 200  # a rounding that depends on the place in the array would show up somewhere
    tension = rng.uniform(0, 10, (count, 4, 6))  # endoscopes, wires, lengths
    friction, bend = rng.uniform(0, 1, (count, 1, 1)), rng.uniform(0, 6, (count, 1, 1))
    together = element_friction(tension, friction_per_tension(friction, bend, 5), 0.1)
    for index in range(count):
        alone = friction_per_tension(friction[index, 0, 0], bend[index, 0, 0], 5)
        np.testing.assert_array_equal(together[index], element_friction(tension[index], alone, 0.1))


@pytest.mark.parametrize("offset", [0.0, 0.8])
@pytest.mark.parametrize("bend", [0.0, 0.5, np.pi, 2 * np.pi])
def test_sliding_wire_obeys_the_capstan_equation(twin, bend, offset):
    preset = SLIDING.replace(sheath_bend=bend, sheath_bend_offset=offset)
    tension = twin.simulate(preset, np.concatenate([THERE, BACK]), SAMPLE_TIME).wire_tension[:, 0]
    pulled, released = tension[PULLED], tension[RELEASED]
    lost = np.exp(-preset.sheath_friction * (bend + offset))
    np.testing.assert_allclose(pulled[:, -1] / pulled[:, 0], lost, rtol=0.02)
    np.testing.assert_allclose(released[:, -1] / released[:, 0], 1 / lost, rtol=0.02)
    per_element = lost ** (1 / preset.sheath_elements)
    np.testing.assert_allclose(pulled[:, 1:] / pulled[:, :-1], per_element, rtol=0.02)


def test_bend_of_the_sheath_and_its_offset_add_up(twin):
    pull = np.concatenate([THERE, BACK])
    whole = twin.simulate(ROUGH.replace(sheath_bend=2.0), pull, SAMPLE_TIME)
    shared = twin.simulate(ROUGH.replace(sheath_bend=1.5, sheath_bend_offset=0.5), pull, SAMPLE_TIME)
    np.testing.assert_array_equal(shared.bend, whole.bend)
    np.testing.assert_array_equal(shared.wire_tension, whole.wire_tension)


def test_sheath_that_has_long_been_bent_further_is_as_if_it_had_always_been(twin):
    """Elements that slide forget: they follow the friction of the bend that the sheath has now."""
    pull = np.linspace(0, 4e-3, 200)
    bend = np.concatenate([np.linspace(0.5, 3.0, 100), np.full(100, 3.0)])
    changing = twin.simulate(SLIDING, pull, SAMPLE_TIME, sheath_bend=bend)
    constant = twin.simulate(SLIDING, pull, SAMPLE_TIME, sheath_bend=3.0)
    np.testing.assert_array_equal(changing.sheath_bend, bend)
    ratio = changing.wire_tension[:, 0, -1] / changing.wire_tension[:, 0, 0]
    np.testing.assert_allclose(ratio[105:], np.exp(-SLIDING.sheath_friction * 3.0), rtol=0.01)
    assert ratio[50] > 1.2 * ratio[150]  # half-way, the sheath was straighter
    np.testing.assert_allclose(changing.wire_tension[150:, 0], constant.wire_tension[150:, 0], rtol=1e-6)
    np.testing.assert_allclose(changing.bend[150:], constant.bend[150:], rtol=1e-6)


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


def test_work_of_the_pulley_is_what_routing_friction_dissipates(twin):
    """First law over a closed cycle: rough vertebrae alone make a loop, the wider the rougher."""
    smooth = SLIDING.replace(pretension=5.0).without_friction().without_viscosity()
    phase = 2 * np.pi * np.arange(401) / 200
    areas = []
    for friction in (0.0, 0.1, 0.2):
        episode = twin.simulate(smooth.replace(routing_friction=friction), 2e-3 * np.sin(phase), SAMPLE_TIME)
        cycle = slice(200, None)
        areas.append(-np.trapezoid(episode.bend[cycle], episode.pull[cycle]))
        work = np.trapezoid(-np.diff(episode.tension[cycle], axis=1)[:, 0], episode.pulley[cycle])

        angle = episode.joint_angle[cycle]
        middle, turned = np.abs(angle[1:] + angle[:-1]) / 2, np.abs(np.diff(angle, axis=0))
        wrapped = np.tril(np.ones((8, 8))) - np.eye(8) / 2  # all guides nearer to the base, half of its own
        at_tip = episode.wire_tension[cycle][1:, :, -1].sum(axis=1)
        torque = friction * smooth.wire_offset * at_tip[:, None] * (middle @ wrapped.T)
        assert work == pytest.approx((torque * turned).sum(), rel=0.01, abs=2e-6)
    assert areas[0] == pytest.approx(0, abs=1e-6)
    assert areas[2] > 1.5 * areas[1] > 1e-5


def friction_of_hinges(endoscope: Endoscope) -> np.ndarray:
    """(planes, groups) torque at which a hinge of the model begins to turn while the other plane is at rest.

    Two tendons oppose both hinges of a vertebra, each by its friction times its coefficient; their directions
    are perpendicular where a torque is told in units of the friction of its plane.
    """
    model, layout = endoscope.model.ptr, endoscope.layout
    groups = len(hinge_groups(endoscope.preset.vertebrae))
    torque = np.empty((2, 2, groups))
    for way, tendons in enumerate(layout.shared[:, -groups:]):
        for group, tendon in enumerate(tendons):
            start, count = model.tendon_adr[tendon], model.tendon_num[tendon]
            coefficient = model.wrap_prm[start : start + count].reshape(2, -1)
            assert (np.ptp(coefficient, axis=1) == 0).all()  # of every hinge of the group alike
            torque[way, :, group] = model.tendon_frictionloss[tendon] * coefficient[:, 0]
    found: np.ndarray = np.hypot(*torque)
    return found


@pytest.mark.parametrize("vertebrae", [5, 20])
def test_hinges_of_the_model_have_the_friction_of_the_wires_that_they_are_bent_by(vertebrae):
    """Each group has the mean of its hinges, by the tension at the tip of the two wires of its plane."""
    preset = ROUGH.replace(
        bending_planes=2, vertebrae=vertebrae, joint_friction_taper=0.5, routing_friction=0.3, sheath_bend=2.0
    )
    pull = 2e-3 * np.sin(2 * np.pi * np.arange(150) / 100)
    noted = []

    def note(endoscope: Endoscope) -> None:
        noted.append(friction_of_hinges(endoscope))

    episode = simulate(preset, pull, preset.control_period, lateral_pull=0.5 * pull, on_sample=note)
    place = (np.arange(vertebrae) + 0.5) / vertebrae
    own = preset.joint_friction * (
        1.5 - place
    )  # from 1.5 times the mean at the base to half of it at the tip
    for k in (0, 40, 90, 148):
        turn = np.hypot(episode.joint_angle[k], episode.lateral_joint_angle[k])
        for plane in range(2):
            at_tip = episode.wire_tension[k, 2 * plane : 2 * plane + 2, -1].sum()
            of_hinges = hinge_friction(own, 0.3 * preset.wire_offset, at_tip, turn)
            expected = [group.mean() for group in np.array_split(of_hinges, noted[k + 1].shape[1])]
            np.testing.assert_allclose(noted[k + 1][plane], expected, rtol=1e-9)


def test_friction_of_a_new_cold_sheath_fades_and_wears():
    cold, worn = ROUGH.replace(friction_warm_up=0.6, warm_up_time=30.0), ROUGH.replace(friction_wear=0.5)
    smoother = ROUGH.replace(friction_warm_up=-0.3, warm_up_time=10.0, friction_wear=0.1)
    loads = EndoscopeBatch([cold, worn, smoother, ROUGH])._loads
    np.testing.assert_allclose(loads.drift(np.zeros(4), np.zeros(4)), [1.6, 1.0, 0.7, 1.0])
    at_30_s = [1 + 0.6 * np.exp(-1), 1 + 0.5 * 2, 1 - 0.3 * np.exp(-3) + 0.1 * 2, 1.0]
    np.testing.assert_allclose(loads.drift(np.full(4, 30.0), np.full(4, 2.0)), at_30_s)
    np.testing.assert_allclose(loads.drift(np.full(4, 1e9), np.zeros(4)), 1.0)


@pytest.mark.parametrize(
    "drift",
    [{"friction_warm_up": 0.8, "warm_up_time": 1.5}, {"friction_wear": 50.0}, {"friction_warm_up": -0.5}],
    ids=["warm-up", "wear", "cold and smooth"],
)
def test_friction_in_the_simulation_follows_its_drift(twin, drift):
    preset = ROUGH.replace(**drift, sheath_bend=2.0)
    pull = 2e-3 * np.sin(2 * np.pi * np.arange(200) / 100)
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


def test_sliding_wire_obeys_the_capstan_equation_of_the_drifted_coefficient(twin):
    preset = SLIDING.replace(sheath_bend=np.pi, friction_warm_up=1.0, warm_up_time=1.0, friction_wear=100.0)
    tension = twin.simulate(preset, THERE, SAMPLE_TIME).wire_tension[PULLED, 0]
    time = len(approach(0.0, preset.control_period)) * preset.control_period + np.arange(101) * SAMPLE_TIME
    factor = (1 + np.exp(-time) + 100.0 * THERE)[PULLED]
    ratio = tension[:, -1] / tension[:, 0]
    np.testing.assert_allclose(ratio, np.exp(-preset.sheath_friction * np.pi * factor), rtol=0.02)
