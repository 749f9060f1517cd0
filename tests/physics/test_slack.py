"""Wires pull and never push: their tension is the force that acts, and where there is none they are slack."""

import numpy as np
from both_twins import MUJOCO
from driven_endoscope import AMPLITUDE, PRESET, SAMPLE_TIME, loop_of, ramp_and_rest, sine

from twin.physics import Endoscope


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
    np.testing.assert_allclose(down.bend, -up.bend, atol=1e-6)
    np.testing.assert_allclose(down.wire_tension, up.wire_tension[:, ::-1], atol=1e-4)
    moving = up.bend[: len(up.bend) - 50]
    assert (np.diff(moving) >= -1e-9).all()
    assert moving[-1] > 1.0
