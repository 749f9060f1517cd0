"""Presets: what no endoscope has is refused by name, limits are allowed, changes are read."""

import math

import pytest
from hypothesis import given
from presets import COUNTS, NUMBERS, values_of

from twin.preset.preset import Preset, parameter_limits, parse_changes

FRICTIONS = {"sheath_friction", "sheath_friction_floor", "joint_friction", "routing_friction"}
REALS = sorted(set(NUMBERS) - set(COUNTS))


def with_value(name: str, value) -> Preset:
    """A preset with one parameter changed; the periods stay multiples of each other."""
    along = {"time_step": {"control_period": value}, "control_period": {"time_step": 1e-6}}
    return Preset("changed").replace(**{name: value}, **along.get(name, {}))


@pytest.mark.parametrize("name", REALS)
def test_limits_of_a_parameter_are_allowed_and_nothing_beyond_them(name):
    low, high = parameter_limits(name)
    assert low < high
    assert low <= getattr(Preset("default"), name) <= high
    for value in (low, high):
        assert getattr(with_value(name, value), name) == value
    for value in (math.nextafter(low, -math.inf), math.nextafter(high, math.inf)):
        with pytest.raises(ValueError, match=f"preset parameter {name} = .*: must ") as refused:
            with_value(name, value)
        assert "\n" not in str(refused.value)


def test_control_period_is_a_multiple_of_the_time_step():
    assert Preset("good", time_step=1e-3, control_period=7e-3).control_period == 7e-3
    for period in (5e-3, 1e-3, 2.0001e-3):
        with pytest.raises(ValueError, match=r"must be a whole multiple of time_step = 0\.002"):
            Preset("bad", time_step=2e-3, control_period=period)


@given(values=values_of(NUMBERS))
def test_changes_are_read_to_the_last_digit_and_of_the_right_type(values):
    changes = parse_changes([f"{name}={value!r}" for name, value in values.items()])
    assert changes == values
    assert [type(value) for value in changes.values()] == [type(value) for value in values.values()]


@pytest.mark.parametrize("change", ["wire_stiffness", "wire_stiffness=soft", "vertebrae=8.5", "", "="])
def test_change_that_is_no_number_is_refused_in_one_line(change):
    rule = "a whole number is needed" if "8.5" in change else "must be NAME=VALUE, as in wire_stiffness=2e4"
    with pytest.raises(ValueError, match=rule) as refused:
        parse_changes(["pretension=5", change])
    assert f"change of the preset {change!r}" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_friction_and_viscosity_are_removed_wholly_and_nothing_else():
    preset = Preset("rough").replace(**dict.fromkeys(FRICTIONS, 0.1))
    for bare, removed in (
        (preset.without_friction(), FRICTIONS),
        (preset.without_viscosity(), {"section_damping", "wire_damping"}),
    ):
        changed = {name for name in NUMBERS if getattr(bare, name) != getattr(preset, name)}
        assert changed == removed
        assert all(getattr(bare, name) == 0 for name in removed)
