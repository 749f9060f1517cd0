"""Presets: what no endoscope has is refused by name, limits are allowed, changes are read."""

import math

import pytest
from hypothesis import given
from presets import COUNTS, NUMBERS, values_of

from twin.preset.preset import Preset, parameter_limits, parse_changes

MUST_BE_POSITIVE = {
    "section_length",
    "section_mass",
    "section_stiffness",
    "wire_offset",
    "wire_stiffness",
    "sheath_length",
    "warm_up_time",
    "pulley_radius",
    "time_step",
    "control_period",
    "sheath_friction_exponent",
}
MAY_BE_NEGATIVE = {
    "initial_bend",
    "lateral_initial_bend",
    "command_zero",
    "lateral_command_zero",
    "joint_friction_taper",
    "friction_warm_up",
    "gravity_x",
    "gravity_y",
    "gravity_z",
}
FRICTIONS = {"sheath_friction", "sheath_friction_floor", "joint_friction", "routing_friction"}
REALS = sorted(set(NUMBERS) - set(COUNTS))


def with_value(name: str, value) -> Preset:
    """A preset with one parameter changed; the periods stay multiples of each other."""
    along = {"time_step": {"control_period": value}, "control_period": {"time_step": 1e-6}}
    return Preset("changed").replace(**{name: value}, **along.get(name, {}))


def rough_preset() -> Preset:
    return Preset("rough").replace(**dict.fromkeys(FRICTIONS, 0.1))


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, True, "soft", None, [1.0], 10**400])
def test_value_that_is_no_number_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"preset parameter {name} = .*: must be a finite number") as refused:
        Preset("bad").replace(**{name: value})
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 150


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


@pytest.mark.parametrize("name", REALS)
def test_sign_of_a_parameter_is_what_it_means(name):
    if name in MUST_BE_POSITIVE:
        with pytest.raises(ValueError, match=rf"{name} = 0\.0: must be positive"):
            with_value(name, 0.0)
    else:
        assert getattr(with_value(name, 0.0), name) == 0.0
    if name in MAY_BE_NEGATIVE:
        value = max(-0.5, parameter_limits(name)[0])
        assert getattr(with_value(name, value), name) == value < 0
    else:
        rule = "positive" if name in MUST_BE_POSITIVE else "not be negative"
        with pytest.raises(ValueError, match=rf"{name} = -1e-09: must (be )?{rule}"):
            with_value(name, -1e-9)


@pytest.mark.parametrize(("name", "limits"), COUNTS.items())
def test_counts_are_whole_and_limited(name, limits):
    low, high = limits
    assert parameter_limits(name) == limits
    for value in limits:
        assert getattr(Preset("many").replace(**{name: value}), name) == value
    for value in (low - 1, high + 1, low + 0.5, float(high)):
        with pytest.raises(ValueError, match=f"must be a whole number from {low} to {high}"):
            Preset("bad").replace(**{name: value})


def test_every_plane_has_two_wires():
    assert [Preset("wires", bending_planes=planes).wires for planes in (1, 2)] == [2, 4]


def test_control_period_is_a_multiple_of_the_time_step():
    assert Preset("good", time_step=1e-3, control_period=7e-3).control_period == 7e-3
    for period in (5e-3, 1e-3, 2.0001e-3):
        with pytest.raises(ValueError, match=r"must be a whole multiple of time_step = 0\.002"):
            Preset("bad", time_step=2e-3, control_period=period)


def test_limits_of_an_unknown_parameter_are_refused_with_the_valid_ones_and_a_guess():
    with pytest.raises(ValueError, match="did you mean 'wire_stiffness'") as refused:
        parameter_limits("wire_stifness")
    assert f"valid: {', '.join(NUMBERS[:5])}" in str(refused.value)
    with pytest.raises(ValueError, match="unknown preset parameter 'name'"):
        parameter_limits("name")


@given(values=values_of(NUMBERS))
def test_changes_are_read_to_the_last_digit_and_of_the_right_type(values):
    changes = parse_changes([f"{name}={value!r}" for name, value in values.items()])
    assert changes == values
    assert [type(value) for value in changes.values()] == [type(value) for value in values.values()]


def test_changes_go_into_a_preset():
    changes = parse_changes(["vertebrae=8", "wire_stiffness=2e4", "gravity_z=-9.81", "gravity_z=-9.8"])
    assert Preset("new").replace(**changes) == Preset("new", vertebrae=8, wire_stiffness=2e4, gravity_z=-9.8)
    assert parse_changes([]) == {}


@pytest.mark.parametrize(
    "change", ["wire_stiffness", "wire_stiffness=", "wire_stiffness=soft", "vertebrae=8.5", "", "=", "name=x"]
)
def test_change_that_is_no_number_is_refused_in_one_line(change):
    rule = "a whole number is needed" if "8.5" in change else "must be NAME=VALUE, as in wire_stiffness=2e4"
    with pytest.raises(ValueError, match=rule) as refused:
        parse_changes(["pretension=5", change])
    assert f"change of the preset {change!r}" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_change_of_an_unknown_parameter_is_refused_by_the_preset():
    with pytest.raises(ValueError, match="unknown preset parameter 'pretention'"):
        Preset("bad").replace(**parse_changes(["pretention=5"]))


def test_friction_and_viscosity_are_removed_wholly_and_nothing_else():
    preset = rough_preset()
    for bare, removed in (
        (preset.without_friction(), FRICTIONS),
        (preset.without_viscosity(), {"section_damping", "wire_damping"}),
    ):
        changed = {name for name in NUMBERS if getattr(bare, name) != getattr(preset, name)}
        assert changed == removed
        assert all(getattr(bare, name) == 0 for name in removed)
