"""The card of a dataset tells the truth about its episodes, in words, in a table and in a figure."""

import io
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from small_dataset import RECIPE, SMALL, TWO_PLANES, changed, contents, make

from twin.dataset import card as dataset_card
from twin.dataset.card import card_text, loops_figure, varying, write_figure
from twin.dataset.recipe import Recipe
from twin.dataset.recipe_file import resolve
from twin.episode import Episode
from twin.files.dataset_json import read_contents
from twin.preset.randomization import Ranges
from twin.recording import read_dataset
from twin.recording.features import FEATURES, recorded
from twin.rendering.camera import Camera

TINY = changed(seconds=0.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    make(folder)
    return folder


def card_of(folder: Path) -> str:
    return (folder / "README.md").read_text()


def table_of(card: str) -> dict[str, list[str]]:
    """The cells of each row of the table of quantities, by its name."""
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in card.splitlines()
        if line.startswith("| `")
    ]
    return {row[0].strip("`"): row[1:] for row in rows}


def test_table_holds_the_statistics_of_all_numbers_of_the_files(folder):
    episodes = read_dataset(folder)
    rows = table_of(card_of(folder))
    assert list(rows) == [feature.name for feature in FEATURES if feature.name in recorded(episodes[0])]
    for name, (_, unit, topic, shape, *figures, count) in rows.items():
        assert unit == next(feature.unit for feature in FEATURES if feature.name == name)
        values = np.stack([recorded(episode)[name] for episode in episodes])
        least, most, mean, deviation = map(float, figures)
        assert least == pytest.approx(values.min(), rel=1e-3, abs=1e-12)
        assert most == pytest.approx(values.max(), rel=1e-3, abs=1e-12)
        assert mean == pytest.approx(values.mean(), rel=1e-3, abs=1e-12)
        assert deviation == pytest.approx(values.std(), rel=1e-3, abs=1e-12)
        assert int(count) == values.size
        assert shape == (" x ".join(map(str, values.shape[2:])) or "1")
        assert topic == f"`{next(feature.topic for feature in FEATURES if feature.name == name)}`"


def card_for(recipe: Recipe, folder: Path) -> str:
    make(folder, recipe)
    return card_of(folder)


def test_card_lists_what_varies(tmp_path):
    recipe = changed(
        TINY,
        preset=TWO_PLANES,
        signals=("sine", "triangle"),
        strokes_mm=((-1.0, 1.0), (0.0, 2.5)),
        lateral_stroke_mm=(0.2, 0.8),
        sheath_bends_deg=((45.0, 45.0), (30.0, 170.0)),
        ranges=Ranges((("pretension", 1.0, 6.0), ("sheath_friction", 0.1, 0.25))),
        sensor_variance_deg2=0.3,
        seeds=(4, 9),
        episodes=4,
    )
    card = card_for(recipe, tmp_path)
    for line in (
        "- signals: sine, triangle",
        "- strokes: [-1, 1], [0, 2.5] mm",
        "- stroke sideways: [0.2, 0.8] mm, by the next of the signals",
        "- bend of the sheath: 45 deg",  # as far as four episodes come
        "- each episode's endoscope, drawn (SI units): `pretension` [1, 6], `sheath_friction` [0.1, 0.25]",
        "- sensor: white noise of 0.3 deg²",
        "- seeds: 4, 9, with 4 episodes each",
    ):
        assert line in card.splitlines()
    assert "- camera" not in card
    drawn = changed(TINY, ranges=Ranges((("sheath_bend", 0.5, 1.0),)), camera=Camera(5.0, 160, 120))
    lines = varying(drawn, read_contents(tmp_path).files)
    assert "camera: 160 x 120, 5 per second" in lines
    assert not [line for line in lines if line.startswith("bend of the sheath")]
    assert "8 episodes of 0.2 s at 50 samples per second (1.6 s in all)" in card
    assert "--replay seed_4_episode_0000.mcap" in card
    assert (tmp_path / "seed_4_episode_0000.mcap").exists()


def test_card_of_a_given_command_names_no_signal_and_no_stroke(tmp_path):
    pull = (1e-3 * np.sin(np.arange(30) / 7)).tolist()
    recipe = resolve({"preset": SMALL.to_dict(), "given_pull_m": pull}, tmp_path)
    card = card_for(recipe, tmp_path / "data")
    assert "- a given command, in `recipe.yaml`" in card.splitlines()
    assert "signals: " not in card
    assert "strokes: " not in card
    assert "1 episode of 0.6 s at 50 samples per second (0.6 s in all)" in card
    assert "The loop of the episode." in card


def test_figure_has_a_panel_for_each_episode_with_its_own_loop(tmp_path):
    make(
        tmp_path,
        changed(seconds=20.0, episodes=2, signals=("sine",), sheath_bends_deg=((45.0, 45.0), (0.0, 90.0))),
    )
    episodes = read_dataset(tmp_path)
    drawn = [axes for axes in loops_figure(episodes).axes if axes.get_visible()]
    assert [axes.get_title() for axes in drawn] == ["sine, sheath 45°", "sine, sheath 0° to 90°"]
    for axes, episode in zip(drawn, episodes, strict=True):
        measured, true = axes.get_lines()
        np.testing.assert_array_equal(true.get_xydata(), np.stack([episode.pull_mm, episode.truth_deg], 1))
        assert 400 <= len(measured.get_xdata()) <= 800  # thinned
        assert set(measured.get_ydata()) <= set(episode.measured_deg)
    picture = Image.open(io.BytesIO((tmp_path / "loops.png").read_bytes()))
    assert picture.format == "PNG"
    assert picture.info["Software"] == "made by endotwin"


@pytest.mark.parametrize(
    ("change", "shown", "caption"),
    [
        ({"episodes": 7}, [0, 1, 2, 3, 4], "Loops of 5 of the 7 episodes."),
        ({"episodes": 4, "seeds": (1, 2)}, [0, 1, 2, 3], "Loops of 4 of the 8 episodes."),
        (
            {"episodes": 16, "strokes_mm": ((-1.0, 1.0), (0.0, 1.0), (0.0, 2.0))},
            [0, 2, 3, 5, 6, 8, 9, 11, 12, 14],
            "Loops of 10 of the 16 episodes.",
        ),
    ],
)
def test_episodes_of_one_seed_are_shown_spread_over_the_combinations(
    tmp_path, monkeypatch, change, shown, caption
):
    drawn: list[Episode] = []

    def note(episodes: Iterable[Episode]) -> Any:
        drawn.extend(episodes)
        return loops_figure(drawn[:1])

    monkeypatch.setattr(dataset_card, "loops_figure", note)
    recipe = changed(TINY, **change)
    card = card_for(recipe, tmp_path)
    assert [episode.metadata["episode"] for episode in drawn] == shown
    assert {episode.metadata["seed"] for episode in drawn} == {recipe.seeds[0]}
    assert f"*{caption} Dark: the true bending angle" in card


def test_card_and_figure_are_the_same_bytes_again_and_in_a_folder_of_another_name(folder, tmp_path):
    copy = tmp_path / "of another name"
    shutil.copytree(folder, copy)
    before = contents(copy)
    for name in ("README.md", "loops.png"):
        (copy / name).unlink()
    for _ in range(2):
        write_figure(copy, RECIPE)
        (copy / "README.md").write_text(card_text(RECIPE, read_contents(copy)))
        assert contents(copy) == before
    assert str(folder) not in card_of(folder)
    assert folder.name not in card_of(folder)
