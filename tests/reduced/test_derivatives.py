"""Derivatives of a record against statics, against longer differences, and as what calibration needs."""

import numpy as np
import pytest
from driven_endoscope import ramp_and_rest

from twin.mechanics.drive import PULLEY_STIFFNESS
from twin.preset.file import load_preset
from twin.reduced import derivatives, simulate

T = 0.1
URETEROSCOPE = load_preset("ureteroscope")
PULL = 2e-3 * np.sin(2 * np.pi * np.arange(80) * T / 8)


def test_without_friction_they_are_those_of_statics():
    """Both wires taut: bend = 2 k r p / (K + 2 k r^2), the pulley's own spring in series."""
    linear = {"wire_stiffening": 0.0, "section_stiffening": 0.0, "pretension": 20.0}
    preset = URETEROSCOPE.without_friction().without_viscosity().replace(**linear)
    pull = ramp_and_rest(1e-3)[::5]
    names = ["section_stiffness", "wire_stiffness", "wire_offset"]
    found = derivatives(preset, pull, T, names)

    def bend(stiffness: float, wire: float, arm: float) -> float:
        yields = 1 / (1 / (2 * wire) + 1 / PULLEY_STIFFNESS)  # of both wires at the pulley
        return yields * arm * pull[-1] / (stiffness + yields * arm**2)

    values = np.array([getattr(preset, name) for name in names])
    assert found.record.bend[-1] == pytest.approx(bend(*values), rel=1e-6)
    for place, name in enumerate(names):
        step = np.where(np.arange(3) == place, 1e-6 * values[place], 0.0)
        slope = (bend(*(values + step)) - bend(*(values - step))) / (2 * step[place])
        assert found.bend[-1, place] == pytest.approx(slope, rel=1e-4), name


def test_one_sided_differences_at_a_limit_are_of_second_order():
    preset = URETEROSCOPE.replace(sheath_friction_floor=0.0)
    found = derivatives(preset, PULL, T, ["sheath_friction_floor"], steps={"sheath_friction_floor": 1e-4})
    one, other = (
        simulate(preset.replace(sheath_friction_floor=value), PULL, T).bend for value in (0.0, 1e-4)
    )
    scale = np.abs(found.bend).max()
    np.testing.assert_allclose(found.bend[:, 0], (other - one) / 1e-4, atol=0.05 * scale)


def test_lateral_bend_has_derivatives_of_its_own():
    preset = URETEROSCOPE.replace(bending_planes=2)
    found = derivatives(preset, 0 * PULL, T, ["section_stiffness"], lateral_pull=PULL)
    one = derivatives(URETEROSCOPE, PULL, T, ["section_stiffness"])
    # Two planes divide a sample, and begin with wires that are wound up otherwise: the first samples differ.
    later = slice(6, None)
    np.testing.assert_allclose(
        found.lateral_bend[later], one.bend[later], rtol=0.01, atol=6e-3 * np.abs(one.bend).max()
    )
    assert not one.lateral_bend.any()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("vertebrae", "a whole number: it has no derivative"),
        ("friction_wear", "has a step of 0: give a positive one"),
        ("sheath_fricton", "unknown preset parameter"),
    ],
)
def test_parameter_without_derivative_is_refused_in_one_line(name, message):
    with pytest.raises(ValueError, match=message) as refused:
        derivatives(URETEROSCOPE, PULL, T, [name])
    assert "\n" not in str(refused.value)
