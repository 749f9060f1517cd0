"""Files of presets: what ships is valid, a file returns its numbers, one that holds no preset is refused."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from presets import NUMBERS, PERIODS, values_of, write

from twin.preset.file import load_preset, preset_names
from twin.preset.preset import Preset


@pytest.mark.parametrize("name", preset_names())
def test_shipped_preset_is_complete_and_named_after_its_file(name):
    preset = load_preset(name)
    assert preset.name == name
    assert 0.5e-3 < preset.wire_offset < 20e-3  # an endoscope, in metres
    assert 5e-3 < preset.section_length < 0.5
    assert 0 <= preset.sheath_friction < 1
    assert preset.sheath_friction_floor > 0
    assert preset.control_period / preset.time_step == pytest.approx(
        round(preset.control_period / preset.time_step)
    )


def test_unknown_parameter_is_refused_with_the_valid_ones_and_a_guess(tmp_path):
    with pytest.raises(ValueError, match="did you mean 'wire_stiffness'") as refused:
        load_preset(write(tmp_path, "wire_stifness: 1.0"))
    assert f"valid: name, {', '.join(NUMBERS[:4])}" in str(refused.value)
    assert len(str(refused.value)) < 300 + len(str(tmp_path))
    with pytest.raises(ValueError, match="unknown preset parameter '7'; valid: name, bending_planes"):
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
        ("", "holds no preset"),
        ("a: [1,", "is not a YAML file"),
        ("wire_stiffness: -5", "must be positive"),
        ("sheath_friction: .nan", "must be a finite number"),
        ("bending_planes: 3", "must be a whole number from 1 to 2"),
        ("encoder_counts: 4e3", "must be a whole number from 0 to 16777216"),
        ("name: 5", "name = 5: must be text"),
    ],
)
def test_file_that_holds_no_preset_is_refused_in_one_line(tmp_path, text, rule):
    with pytest.raises(ValueError, match=rule) as refused:
        load_preset(write(tmp_path, text))
    assert "\n" not in str(refused.value)


@given(values=values_of(sorted(set(NUMBERS) - PERIODS)), steps=st.integers(1, 50))
def test_preset_comes_back_from_yaml_to_the_last_digit(tmp_path_factory, values, steps):
    preset = Preset("round", time_step=1e-3, control_period=steps * 1e-3).replace(**values)
    path = tmp_path_factory.getbasetemp() / "round.yaml"
    path.write_text(yaml.safe_dump(preset.to_dict()))
    assert load_preset(path) == preset
