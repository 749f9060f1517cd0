"""The line of the nominal twin against the equilibrium of two taut wires, and the symmetry of a loop."""

import numpy as np
import pytest
from controlled import PRESET
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.control.controller import Line, fit_line
from twin.signals.excitation import command
from twin.simulation import simulate

T = 0.02
LINEAR = PRESET.without_friction().without_viscosity().replace(section_stiffening=0.0, wire_stiffening=0.0)


def slope_of_taut_wires(preset) -> float:
    """Bend by pull [deg / mm]: the section's moment K theta is that of the wires, 2 k r (u - r theta)."""
    k, r, K = preset.wire_stiffness, preset.wire_offset, preset.section_stiffness
    return float(np.degrees(2 * k * r / (K + 2 * k * r**2)) * 1e-3)


@settings(max_examples=10)
@given(
    st.floats(3500, 6000),
    st.floats(0.9e-3, 1.3e-3),
    st.floats(0.015, 0.03),
    st.floats(-2e-4, 2e-4),
)
def test_without_friction_and_slack_it_is_that_of_the_equilibrium(k, r, K, zero):
    preset = LINEAR.replace(wire_stiffness=k, wire_offset=r, section_stiffness=K, command_zero=zero)
    slope = slope_of_taut_wires(preset)
    line = fit_line(preset, (-1.0, 1.6))
    assert line.slope == pytest.approx(slope, rel=5e-3)
    assert line.offset_deg == pytest.approx(-slope * zero * 1e3, abs=0.05)
    np.testing.assert_allclose(
        line.reached_deg, slope * (np.array([-1.0, 1.6]) - zero * 1e3), rtol=5e-3, atol=0.05
    )


def test_without_friction_and_slack_it_foretells_the_bend_of_any_command():
    line = fit_line(LINEAR, (-1.5, 1.5))
    pull = command("multi-sine", (-1.5e-3, 1.5e-3), 10.0, T, np.random.default_rng(1))
    for physics in ("reduced", "mujoco"):
        episode = simulate(LINEAR, pull, T, physics=physics)
        foretold = line.slope * episode.pull_mm + line.offset_deg
        np.testing.assert_allclose(foretold, episode.truth_deg, atol=0.1)


def test_with_friction_a_stroke_about_zero_has_a_line_through_zero():
    line = fit_line(PRESET, (-3.0, 3.0))
    assert line.offset_deg == pytest.approx(0.0, abs=1e-6)
    assert sum(line.reached_deg) == pytest.approx(0.0, abs=1e-6)
    assert 0 < line.slope < slope_of_taut_wires(LINEAR) * 2


def test_a_section_that_is_bent_by_itself_moves_the_line_up():
    straight, bent = (fit_line(PRESET.replace(initial_bend=bend), (-3.0, 3.0)) for bend in (0.0, 0.1))
    assert 0 < bent.offset_deg - straight.offset_deg < np.degrees(0.1)


@given(st.floats(1, 100), st.floats(-50, 50), st.floats(-90, 90))
def test_its_pull_brings_the_bend(slope, offset, bend):
    line = Line(slope, offset, (-60.0, 60.0))
    assert line.slope * line.pull_mm(bend) + line.offset_deg == pytest.approx(bend, abs=1e-9)
