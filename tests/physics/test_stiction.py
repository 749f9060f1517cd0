"""Friction at rest that exceeds that of sliding: the tip moves in steps, by Hooke and Coulomb."""

import numpy as np
import pytest
from both_twins import MUJOCO, REDUCED, same_state
from plain_endoscope import PLAIN

from twin.mechanics.wire import segment_stiffness
from twin.preset.file import load_preset

T = 0.02  # [s]
FLOOR, STICTION = 2.0, 0.5  # [N], [-]
# One wire, one element, friction that does not depend on the load: a block between two springs.
BLOCK = PLAIN.replace(
    name="block",
    wires_per_plane=1,
    sheath_elements=1,
    sheath_friction=0.0,
    sheath_friction_floor=FLOOR,
    joint_friction=0.0,
    pretension=20.0,
    stiction=STICTION,
    section_damping=0.0,
    wire_damping=0.0,
)
RAMP = np.linspace(0, 2e-3, 1000)
PULLED = segment_stiffness(BLOCK)  # [N / m]
PUSHED_BACK = 1 / (1 / PULLED + BLOCK.wire_offset**2 / BLOCK.section_stiffness)  # by segment and section
BETWEEN = STICTION * FLOOR / PULLED  # pull from one step to the next [m]
STEP = BETWEEN * PULLED / (PULLED + PUSHED_BACK) * PUSHED_BACK * BLOCK.wire_offset / BLOCK.section_stiffness


def steps(preset, twin) -> tuple[np.ndarray, np.ndarray]:
    """Pull at the beginning of each step along a slow ramp [m], and bend after it [rad]."""
    episode = twin.simulate(preset, RAMP, T)
    moving = np.diff(episode.bend) > 0.02 * STEP
    begin = np.flatnonzero(moving & ~np.concatenate([[False], moving[:-1]]))
    end = np.flatnonzero(~moving & np.concatenate([[False], moving[:-1]]))
    begin = begin[: len(end)]
    return RAMP[begin], episode.bend[end]


def test_it_breaks_away_at_the_friction_at_rest_and_moves_in_steps(twin):
    """From (1 + stiction) F down to F: k times the pull between two steps is what is let go in each."""
    begin, bend = steps(BLOCK, twin)
    assert begin[0] == pytest.approx((1 + STICTION) * FLOOR / PULLED, rel=0.02)
    assert len(begin) > 20
    assert np.diff(begin).mean() == pytest.approx(BETWEEN, rel=0.1)
    assert np.diff(bend).mean() == pytest.approx(STEP, rel=0.1)
    assert np.diff(begin).std() < 0.2 * BETWEEN


def test_hysteresis_of_a_whole_cycle_has_both_frictions(twin):
    """The loop lies between those of friction as in sliding and of friction as at rest."""
    swing = 2e-3 * np.sin(np.linspace(0, 4 * np.pi, 4000))
    half = len(swing) // 2

    def area(preset):
        episode = twin.simulate(preset, swing, T)
        return abs(np.trapezoid(episode.bend[half:], swing[half:]))

    least = area(BLOCK.replace(stiction=0.0))
    most = area(BLOCK.replace(stiction=0.0, sheath_friction_floor=(1 + STICTION) * FLOOR))
    assert 1.05 * least < area(BLOCK) < 0.95 * most


def test_planes_stick_and_slip_as_one(twin):
    """A ramp in a direction between both planes has the steps of one in the first plane, along it."""
    two = BLOCK.replace(bending_planes=2, wires_per_plane=2)
    straight = twin.simulate(two, RAMP, T)
    turned = twin.simulate(two, 0.6 * RAMP, T, lateral_pull=0.8 * RAMP)
    along = 0.6 * turned.bend + 0.8 * turned.lateral_bend
    across = 0.6 * turned.lateral_bend - 0.8 * turned.bend
    assert np.abs(across).max() < 0.05 * STEP
    assert np.abs(along - straight.bend).max() < 3 * STEP
    ratio = np.diff(along).max() / np.diff(straight.bend).max()
    assert 0.5 < ratio < 2.0


@pytest.mark.parametrize("planes", [1, 2])
def test_state_and_batch_know_what_is_held(twin, planes):
    preset = BLOCK.replace(bending_planes=planes, sheath_elements=2)
    lateral = 0.5 * RAMP[:300] if planes == 2 else None
    other = preset.replace(stiction=0.0)
    alone = twin.simulate(preset, RAMP[:300], T, lateral_pull=lateral)
    laterals = None if lateral is None else [lateral, lateral]
    together = twin.simulate_batch([preset, other], [RAMP[:300]] * 2, T, lateral_pulls=laterals)
    np.testing.assert_array_equal(together[0].bend, alone.bend)
    assert np.abs(together[1].bend - alone.bend).max() > 0.1 * STEP

    for sample in (60, 137):  # at rest, and about to slide
        first, fresh, whole = (twin.endoscope.from_preset(preset) for _ in range(3))
        twin.simulate(preset, RAMP[:300], T, lateral_pull=lateral, endoscope=whole)
        before = None if lateral is None else lateral[: sample + 1]
        twin.simulate(preset, RAMP[: sample + 1], T, lateral_pull=before, endoscope=first)
        after = None if lateral is None else lateral[sample:300]
        rest = twin.simulate(
            preset, RAMP[sample:300], T, lateral_pull=after, state=first.save_state(), endoscope=fresh
        )
        np.testing.assert_array_equal(rest.bend, alone.bend[sample:])
        assert same_state(fresh.save_state(), whole.save_state())


def test_twins_stay_within_a_step_of_each_other():
    """When each of many elements slips is chance; where the tip is, is not."""
    preset = load_preset("vio_com").replace(stiction=0.5)
    swing = 8e-3 * np.sin(np.linspace(0, 3 * np.pi, 1500))
    one, other = (twin.simulate(preset, swing, T).bend for twin in (MUJOCO, REDUCED))
    smooth = MUJOCO.simulate(preset.replace(stiction=0.0), swing, T).bend
    assert np.sqrt(np.mean((one - other) ** 2)) < 0.01 * np.ptp(one)
    assert np.abs(np.diff(one)).max() > 1.5 * np.abs(np.diff(smooth)).max()
