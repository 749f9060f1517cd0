"""Presets: what ships is valid, what no endoscope has is refused by name, a file returns its numbers."""

import dataclasses
import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from twin.preset import Preset, load_preset, preset_names

MAY_BE_ZERO = {
    "section_damping",
    "joint_friction",
    "wire_damping",
    "pretension",
    "sheath_friction",
    "sheath_bend",
    "sheath_friction_floor",
}
NUMBERS = [field.name for field in dataclasses.fields(Preset) if field.name != "name"]
COUNTS = ["vertebrae", "sheath_elements"]
REALS = sorted(set(NUMBERS) - set(COUNTS))
PERIODS = {"time_step", "control_period"}


def write(tmp_path, text: str):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", preset_names())
def test_shipped_preset_is_complete_and_named_after_its_file(name):
    preset = load_preset(name)
    assert preset.name == name
    assert 0.5e-3 < preset.wire_offset < 20e-3  # an endoscope, in metres
    assert 5e-3 < preset.section_length < 0.5
    assert 0 < preset.sheath_friction < 1
    assert preset.control_period / preset.time_step == pytest.approx(
        round(preset.control_period / preset.time_step)
    )


def test_ureteroscope_ships_with_its_documented_geometry():
    preset = load_preset("ureteroscope")
    assert (preset.vertebrae, preset.section_length, preset.wire_offset) == (16, 0.04, 1.3e-3)
    assert preset.sheath_bend == pytest.approx(math.pi)


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf, True, "soft", None, [1.0]])
def test_value_that_no_endoscope_has_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"preset parameter {name} = ") as refused:
        Preset("bad").replace(**{name: value})
    assert "must" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", REALS)
def test_zero_is_allowed_where_a_term_can_be_absent(name):
    if name in MAY_BE_ZERO:
        assert getattr(Preset("absent").replace(**{name: 0.0}), name) == 0.0
    else:
        with pytest.raises(ValueError, match=f"{name} = 0.0: must be positive"):
            Preset("bad").replace(**{name: 0.0})


@pytest.mark.parametrize(("name", "limit"), [("vertebrae", 128), ("sheath_elements", 64)])
def test_counts_are_whole_and_limited(name, limit):
    assert getattr(Preset("many").replace(**{name: limit}), name) == limit
    for value in (0, limit + 1, 4.5, 4.0):
        with pytest.raises(ValueError, match=f"must be a whole number from 1 to {limit}"):
            Preset("bad").replace(**{name: value})


def test_control_period_is_a_multiple_of_the_time_step():
    assert Preset("good", time_step=1e-3, control_period=7e-3).control_period == 7e-3
    for period in (5e-3, 1e-3, 2.0001e-3):
        with pytest.raises(ValueError, match=r"must be a whole multiple of time_step = 0\.002"):
            Preset("bad", time_step=2e-3, control_period=period)


def test_unknown_parameter_is_refused_with_the_valid_ones_and_a_guess(tmp_path):
    with pytest.raises(ValueError, match="did you mean 'wire_stiffness'") as refused:
        load_preset(write(tmp_path, "wire_stifness: 1.0"))
    for name in NUMBERS:
        assert name in str(refused.value)
    with pytest.raises(ValueError, match="unknown preset parameter '7'; valid: name, vertebrae"):
        load_preset(write(tmp_path, "7: 1.0"))


def test_unknown_preset_is_refused_with_the_valid_ones_and_a_guess():
    with pytest.raises(ValueError, match="unknown preset 'uretroscope'") as refused:
        load_preset("uretroscope")
    assert "did you mean 'ureteroscope'" in str(refused.value)
    for name in preset_names():
        assert name in str(refused.value)


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("- 1\n- 2", "holds no preset"),
        ("just words", "holds no preset"),
        ("", "holds no preset"),
        ("a: [1,", "is not a YAML file"),
        ("wire_stiffness: -5", "must be positive"),
        ("sheath_friction: .nan", "must be a finite number"),
        ("name: 5", "name = 5: must be text"),
    ],
)
def test_file_that_holds_no_preset_is_refused_in_one_line(tmp_path, text, rule):
    with pytest.raises(ValueError, match=rule) as refused:
        load_preset(write(tmp_path, text))
    assert "\n" not in str(refused.value)


def test_missing_and_binary_files_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.yaml"):
        load_preset(tmp_path / "none.yaml")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ValueError, match="is not a YAML file"):
        load_preset(binary)


@given(
    reals=st.fixed_dictionaries(
        {}, optional={name: st.floats(1e-12, 1e12) for name in REALS if name not in PERIODS}
    ),
    vertebrae=st.integers(1, 128),
    steps=st.integers(1, 50),
)
def test_preset_comes_back_from_yaml_to_the_last_digit(tmp_path_factory, reals, vertebrae, steps):
    preset = Preset("round", time_step=1e-3, control_period=steps * 1e-3).replace(
        vertebrae=vertebrae, **reals
    )
    path = tmp_path_factory.getbasetemp() / "round.yaml"
    path.write_text(yaml.safe_dump(preset.to_dict()))
    assert load_preset(path) == preset


def test_file_states_only_what_differs(tmp_path):
    assert load_preset(write(tmp_path, "pretension: 5")) == Preset("mine", pretension=5)


def test_friction_and_viscosity_are_removed_wholly_and_nothing_else():
    preset = load_preset("ureteroscope")
    for bare, removed in (
        (preset.without_friction(), {"sheath_friction", "sheath_friction_floor", "joint_friction"}),
        (preset.without_viscosity(), {"section_damping", "wire_damping"}),
    ):
        changed = {name for name in NUMBERS if getattr(bare, name) != getattr(preset, name)}
        assert changed == removed
        assert all(getattr(bare, name) == 0 for name in removed)


def test_a_number_without_point_and_sign_in_its_exponent_is_a_number(tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text("wire_stiffness: 2e4\nname: 2e4\n")
    assert load_preset(path).wire_stiffness == 2e4
    assert load_preset(path).name == "2e4"
