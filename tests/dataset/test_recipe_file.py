"""A recipe's file: what each key becomes, and what is refused, in one line with what may be."""

import copy
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from twin.dataset.recipe import Recipe
from twin.dataset.recipe_file import change_recipe, load_recipe, parse_recipe, resolve, resolve_alone
from twin.measured.command import read_command
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges, load_ranges
from twin.rendering.camera import Camera
from twin.signals.excitation import SIGNALS

HERE = Path()
EVERY_KEY = """
preset: parts/mine.yaml
set: {wire_damping: 2.5, vertebrae: 7}
ranges: {pretension: [1, 6]}
episodes: 7
seeds: [4, 2]
seconds: 1.5
sample_time_s: 0.04
signals: [triangle, sine]
strokes_mm: [[-1, 1], [0, 2.5]]
lateral_stroke_mm: [-0.5, 0.5]
sheath_bends_deg: [45, [null, 180], [90, 0]]
sensor: {variance_deg2: 0.3, noise_deg: 2, resolution_deg: 0.5, period_s: 0.04, latency_s: 0.02}
camera: {pictures_per_second: 5, width: 160, height: 120}
"""


def resolved(text: str) -> Recipe:
    return resolve(parse_recipe(text), HERE)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "mine.yaml").write_text(
        "vertebrae: 5\nbending_planes: 2\nsheath_bend: 1.5707963267948966\nwire_stiffness: 1e4\n"
        "ranges: {pretension: [1, 2], sheath_friction: [0.1, 0.3]}\n"
    )
    (tmp_path / "parts" / "command.csv").write_text("time_s,pull_mm\n0,0\n1,1.5\n2,-0.5\n")
    return tmp_path


def test_every_key_of_the_file_is_in_the_recipe(folder):
    (folder / "recipe.yaml").write_text(EVERY_KEY)
    recipe = load_recipe(folder / "recipe.yaml")
    preset = load_preset(folder / "parts" / "mine.yaml").replace(
        wire_damping=2.5,
        vertebrae=7,
        sensor_noise=float(np.radians(2)),
        sensor_resolution=float(np.radians(0.5)),
        sensor_period=0.04,
        sensor_latency=0.02,
    )
    assert recipe == Recipe(
        preset=preset,
        strokes_mm=((-1.0, 1.0), (0.0, 2.5)),
        lateral_stroke_mm=(-0.5, 0.5),
        sheath_bends_deg=((45.0, 45.0), (90.0, 180.0), (90.0, 0.0)),
        ranges=Ranges((("pretension", 1.0, 6.0),)),
        seconds=1.5,
        sample_time_s=0.04,
        signals=("triangle", "sine"),
        sensor_variance_deg2=0.3,
        camera=Camera(5.0, 160, 120),
        episodes=7,
        seeds=(4, 2),
    )


def test_recipe_of_no_keys_is_that_of_the_defaults():
    given = resolved("preset: {name: mine, vertebrae: 5, pretension: 2.5}").preset
    assert given == Preset("mine", vertebrae=5, pretension=2.5)
    for text in ("{}", "", "# nothing but a comment"):
        assert resolved(text) == Recipe(load_preset("ureteroscope"))


def test_paths_are_relative_to_the_recipe(folder):
    (folder / "recipe.yaml").write_text("preset: parts/mine.yaml\ncommand_csv: parts/command.csv\n")
    recipe = load_recipe(folder / "recipe.yaml")
    pull = read_command(folder / "parts" / "command.csv", recipe.preset, 0.02)[0]
    assert recipe.given_pull_m == tuple(pull.tolist())
    assert recipe.seconds == pytest.approx(2.0)
    assert recipe.strokes_mm == (
        (pytest.approx(1e3 * pull.min(), abs=1e-8), pytest.approx(1e3 * pull.max(), abs=1e-8)),
    )
    assert {recipe.conditions(number).signal for number in range(3)} == {"given"}


def test_columns_of_a_command_are_named_with_its_path(folder):
    (folder / "parts" / "log.csv").write_text("t_ms,knob_deg,side\n0,0,0\n500,10,1\n1000,0,2\n")
    command = "{file: log.csv, command_column: knob_deg, lateral_command_column: side, time_column: t_ms}"
    text = f"preset: mine.yaml\nset: {{bending_planes: 2}}\ncommand_csv: {command}\n"
    (folder / "parts" / "recipe.yaml").write_text(text)
    with pytest.raises(ValueError, match="column side does not end in its unit"):
        load_recipe(folder / "parts" / "recipe.yaml")
    (folder / "parts" / "log.csv").write_text("t_ms,knob_deg,side_mm\n0,0,0\n500,10,1\n1000,0,2\n")
    (folder / "parts" / "recipe.yaml").write_text(text.replace("side,", "side_mm,"))
    recipe = load_recipe(folder / "parts" / "recipe.yaml")
    assert (len(recipe.given_pull_m), len(recipe.given_lateral_pull_m)) == (50, 50)
    assert max(recipe.given_pull_m) == pytest.approx(np.radians(10) * recipe.preset.pulley_radius)
    assert recipe.given_lateral_pull_m[25] == pytest.approx(1e-3)
    assert resolve_alone(recipe.to_dict()) == recipe
    for change, fault in (
        ({"preset": recipe.preset.replace(bending_planes=1)}, r"a lateral command: .* it needs two"),
        ({"lateral_stroke_mm": (0.0, 1.0)}, "lateral_stroke_mm and a recorded lateral command: choose one"),
        ({"given_lateral_pull_m": (0.0, 0.0, 0.0)}, "given_lateral_pull_m has 3 samples, given_pull_m 50"),
        ({"given_lateral_pull_m": (0.0, 0.1) * 25}, r"stroke \[0, 100\] mm: this endoscope"),
    ):
        with pytest.raises(ValueError, match=fault):
            dataclasses.replace(recipe, **change).check()


def test_randomize_draws_from_the_ranges_of_the_preset(folder):
    assert resolved("preset: ureteroscope\nrandomize: true").ranges == load_ranges("ureteroscope")
    (folder / "recipe.yaml").write_text(
        "preset: parts/mine.yaml\nrandomize: true\nset: {pretension: 3}\nsheath_bends_deg: [10]\n"
    )
    assert load_recipe(folder / "recipe.yaml").ranges == Ranges((("sheath_friction", 0.1, 0.3),))


@pytest.mark.parametrize(
    ("text", "episodes"),
    [
        ("{}", len(SIGNALS)),
        ("signals: [sine]", 5),
        ("signals: [sine, triangle]\nstrokes_mm: [[-1, 1], [0, 1]]", 5),
        ("strokes_mm: [[-1, 1], [0, 1]]\nsheath_bends_deg: [0, 90, 180]", 30),
        ("strokes_mm: [[-1, 1], [0, 1]]\nsheath_bends_deg: [0, 90, 180]\nepisodes: 2", 2),
        ("given_pull_m: [0, 0.001]", 1),
        ("given_pull_m: [0, 0.001]\nsheath_bends_deg: [0, 90, 180]", 3),
        ("given_pull_m: [0, 0.001]\nranges: {pretension: [1, 2]}", 5),
    ],
)
def test_without_a_number_of_episodes_there_is_one_of_each_combination_but_five_or_more(text, episodes):
    recipe = resolved(text)
    assert recipe.episodes == episodes
    assert len(recipe.keys) == episodes


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seed: 4", "unknown key seed; valid: preset, set, randomize, ranges"),
        ("sensor: {noise: 1}", "unknown key sensor.noise; valid: variance_deg2, noise_deg"),
        ("camera: {height: 100}", "camera: 320 x 100 pixels: must be even, 80 to 1280 and 120 to 1280"),
        ("seeds: [1, 1.5]", r"seeds\[1\] = 1.5: must be a valid integer"),
        ("seconds: .inf", "seconds = inf: must be a finite number"),
        ("seconds: -1", "-1 s at a sample time of 0.02 s: needs at least two samples"),
        ("signals: [sinus]", "unknown signal 'sinus'; valid: sine, decaying-sine"),
        ("preset: ureter", r"unknown preset 'ureter' \(did you mean 'ureteroscope'\?\); valid: ureteroscope"),
        ("preset: {vertebrae: 8}", "preset: parameters need a `name` among them"),
        ("set: {vertebra: 8}", r"unknown preset parameter 'vertebra' \(did you mean 'vertebrae'\?\)"),
        ("set: {vertebrae: 8.5}", "vertebrae = 8.5: must be a whole number from 1 to 128"),
        ("randomize: true\npreset: {name: x}", "given by its parameters states no ranges; give `ranges`"),
        ("randomize: true\nranges: {pretension: [1, 2]}", "randomize and ranges: choose one"),
        ("ranges: {pretension: [2, 1]}", r"range of pretension = \[2, 1\]: must rise, within \[0, 500\]"),
        ("given_pull_m: [0.001]", "given_pull_m = .* at least 2 items"),
        ("given_pull_m: [0, 1]", r"stroke \[0, 1000\] mm: this endoscope is pulled by at most 51.1 mm"),
        ("given_pull_m: [0, 1]\ncommand_csv: a.csv", "command_csv and given_pull_m: choose one"),
        ("[1, 2]", "no recipe: expected `key: value` lines"),
        ("{set: {pretension: 3}, ranges: {pretension: [1, 6]}}", "ranges: pretension is set, or bent by"),
        ("{command_csv: parts/command.csv, seconds: 3}", "command_csv and seconds: choose one"),
        ("command_csv: {file: a.csv, time_unit: h}", "command_csv.time_unit = 'h': must be 's', 'ms'"),
        ("a: b: c", "not a YAML file: line 1: mapping values are not allowed"),
    ],
)
def test_wrong_recipe_is_refused_in_one_line(text, message):
    with pytest.raises(ValueError, match=message) as refused:
        resolved(text)
    assert "\n" not in str(refused.value)


def test_recipe_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no recipe .*nothing\.yaml"):
        load_recipe(tmp_path / "nothing.yaml")
    for text, message in (
        ("preset: none.yaml", "no preset file .*none.yaml"),
        ("command_csv: none.csv", "no command file .*none"),
    ):
        with pytest.raises(FileNotFoundError, match=message):
            resolved(text)
    contents = {"yaml": b"a: [1", "utf": b"a: \xff\xfe", "list": b"- 1"}
    for name, data in contents.items():
        path = tmp_path / f"{name}.yaml"
        path.write_bytes(data)
        with pytest.raises(ValueError, match=f"{name}.yaml: ") as refused:
            load_recipe(path)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("values", "changes", "changed"),
    [
        (
            {"seconds": 60, "set": {"pretension": 3, "vertebrae": 6}, "seeds": [1, 2]},
            {"seconds": 10, "set": {"pretension": 4}, "sensor": {"variance_deg2": 2}},
            {
                "seconds": 10,
                "set": {"pretension": 4, "vertebrae": 6},
                "seeds": [1, 2],
                "sensor": {"variance_deg2": 2},
            },
        ),
        ({"given_pull_m": [1.0]}, {"command_csv": "x"}, {"command_csv": "x"}),
        ({"ranges": {"pretension": [1, 2]}}, {"randomize": True}, {"randomize": True}),
        ({"ranges": {"a": [1, 2]}}, {"seconds": 1}, {"ranges": {"a": [1, 2]}, "seconds": 1}),
        (
            {"command_csv": "a.csv"},
            {"command_csv": {"command_column": "knob_deg"}},
            {"command_csv": {"file": "a.csv", "command_column": "knob_deg"}},
        ),
    ],
)
def test_changes_override_the_file_and_leave_the_rest(values, changes, changed):
    before = copy.deepcopy(values)
    assert change_recipe(values, changes) == changed
    assert values == before
