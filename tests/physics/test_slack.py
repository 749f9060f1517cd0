"""Wires pull and never push: their tension is the force that acts, and where there is none they are slack."""

import numpy as np
import pytest
from both_twins import MUJOCO, REDUCED
from driven_endoscope import AMPLITUDE, PRESET, SAMPLE_TIME, loop_of, ramp_and_rest, sine

from twin.physics import Endoscope
from twin.preset.preset import Preset


def test_tension_is_the_force_that_acts_and_never_pushes():
    """The springs act on a sheath element with the tension of the length before it less that behind it."""
    acting, read = [], []

    def note(endoscope: Endoscope) -> None:
        endoscope.forward()  # the forces of a step are those at its beginning
        force = endoscope.named.data.qfrc_spring
        elements = range(PRESET.sheath_elements)
        acting.append([[force[f"sheath_{wire}{i}"][0] for i in elements] for wire in "ab"])
        read.append(endoscope.wire_tension())

    loop_of(MUJOCO, PRESET, 8.0, on_sample=note)
    tension = np.array(read)
    np.testing.assert_allclose(acting, -np.diff(tension, axis=-1), atol=1e-4)  # the MJCF text has 6 digits
    assert (tension >= 0).all()
    assert (tension[:, :, [0, -1]] == 0).any(axis=0).all()  # slack at times, at the pulley and at the tip


def test_slack_is_what_the_way_of_the_wire_leaves_over(twin):
    """No wire is lost: stretch (less slack) grows by what the pulley takes up less what the tip gives."""
    loop_episode = twin.simulate(PRESET, sine(8.0, 2), SAMPLE_TIME)
    stiffness = PRESET.wire_stiffness * (PRESET.sheath_elements + 1)  # of one of the lengths in series
    half = PRESET.wire_stiffening * stiffness / 2
    stretched = (np.sqrt(1 + 4 * half * loop_episode.wire_tension / stiffness) - 1) / (2 * half)
    stretch = (stretched - loop_episode.wire_slack).sum(axis=2)  # (samples, wires)
    taken_up = loop_episode.pulley - PRESET.wire_offset * loop_episode.bend
    for wire, side in enumerate((1.0, -1.0)):
        grown = side * (taken_up - taken_up[0])
        np.testing.assert_allclose(stretch[:, wire] - stretch[0, wire], grown, atol=1e-12)


def test_opposite_pulls_bend_to_opposite_sides_and_bend_rises_with_pull(twin):
    up = twin.simulate(PRESET, ramp_and_rest(AMPLITUDE), SAMPLE_TIME)
    down = twin.simulate(PRESET, ramp_and_rest(-AMPLITUDE), SAMPLE_TIME)
    np.testing.assert_allclose(down.bend, -up.bend, atol=3e-6)
    np.testing.assert_allclose(down.wire_tension, up.wire_tension[:, ::-1], atol=1e-4)
    moving = up.bend[: len(up.bend) - 50]
    assert (np.diff(moving) >= -1e-9).all()
    assert moving[-1] > 1.0


@pytest.mark.parametrize("time_step", [2.5e-3, 1.25e-3, 6.25e-4])
@pytest.mark.parametrize("period", [1.0, 0.4])
def test_slack_wire_that_slides_easily_and_stiffens_is_stable_at_any_time_step(time_step, period):
    """An element that slides pulls its neighbour from slack to many times its stiffness within a period."""
    preset = Preset(
        "slack",
        vertebrae=8,
        section_stiffness=0.03,
        section_damping=0.0,
        joint_friction=3e-4,
        wire_offset=2.2e-3,
        routing_friction=0.5,
        wire_stiffness=4e3,
        wire_stiffening=1.3,
        wire_damping=0.0,
        wire_slack=1e-5,
        sheath_friction=0.0,
        sheath_friction_floor=0.03,
        time_step=time_step,
    )
    pull = sine(period, 3.0 / period)
    bend, expected = (one.simulate(preset, pull, SAMPLE_TIME).bend for one in (MUJOCO, REDUCED))
    off = (bend - expected) / np.ptp(expected)
    assert np.sqrt(np.mean(off**2)) < 0.01
    assert np.abs(off).max() < 0.03
