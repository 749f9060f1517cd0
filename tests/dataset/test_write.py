"""Datasets: the same bytes by any workers, episodes that follow their recipe, errors before any work."""

import hashlib
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from small_dataset import FALLING, SMALL, TWO_PLANES, changed, contents, make

from twin.dataset.episodes import make_episode, make_episodes
from twin.dataset.recipe import EpisodeKey, Recipe, in_metres
from twin.dataset.write import write_dataset
from twin.episode import Episode
from twin.preset.randomization import Ranges
from twin.recording import read_episode

RANGES = Ranges(
    (("pretension", 1.0, 6.0), ("section_stiffness", 0.03, 0.05), ("sensor_resolution", 1e-3, 1e-2))
)
PLAIN = changed(seconds=2.0)
RICH = changed(
    preset=TWO_PLANES,
    lateral_stroke_mm=(0.2, 0.8),
    sheath_bends_deg=((30.0, 170.0),),
    ranges=RANGES,
    sensor_variance_deg2=0.0,
)
"""Two planes, a sheath that is being bent, and an endoscope of its own for each episode."""


def episode_of(recipe: Recipe, number: int, seed: int = 11) -> Episode:
    return make_episode(recipe, EpisodeKey(seed, number))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    make(folder, PLAIN, csv=True)
    return folder


def test_same_seed_gives_the_same_bytes_whatever_the_number_of_workers(folder, tmp_path):
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        write_dataset(PLAIN, tmp_path, executor, workers=2, csv=True)
    assert contents(tmp_path) == contents(folder)


@pytest.mark.parametrize("recipe", [PLAIN, RICH], ids=["plain", "rich"])
def test_an_episode_is_the_same_alone_and_among_others(recipe):
    keys = [EpisodeKey(11, 2), EpisodeKey(4, 0), EpisodeKey(11, 1)]
    for key, together in zip(keys, make_episodes(recipe, keys), strict=True):
        alone = make_episode(recipe, key)
        assert together is not None
        for field in ("pull", "bend", "measured_bend", "wire_tension", "sheath_friction", "wire_slack"):
            np.testing.assert_array_equal(getattr(together, field), getattr(alone, field))
        assert together.metadata == alone.metadata
        assert together.attachments == alone.attachments


def test_several_seeds_give_files_of_their_own_that_are_those_of_each_seed(tmp_path):
    make(tmp_path / "both", changed(episodes=2, seeds=(11, 12)))
    names = [f"seed_{seed}_episode_000{number}.mcap" for seed in (11, 12) for number in range(2)]
    assert [path.name for path in sorted((tmp_path / "both").glob("*.mcap"))] == names
    make(tmp_path / "one", changed(episodes=2, seeds=(12,)))
    for number in range(2):
        of_both = tmp_path / "both" / f"seed_12_episode_000{number}.mcap"
        assert of_both.read_bytes() == (tmp_path / "one" / f"episode_000{number}.mcap").read_bytes()


def test_dataset_file_describes_every_episode_and_its_table(folder):
    described = json.loads((folder / "dataset.json").read_text())
    assert described["recipe"]["strokes_mm"] == [[-1, 1]]
    assert described["episodes"] == len(described["files"]) == 3
    assert described["seconds"] == pytest.approx(3 * 2.0)
    assert described["bytes"] == sum(path.stat().st_size for path in folder.glob("*.mcap"))
    for number, entry in enumerate(described["files"]):
        path = folder / f"episode_{number:04d}.mcap"
        assert (entry["name"], entry["bytes"]) == (path.name, path.stat().st_size)
        assert entry["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
        assert entry["table_sha256"] == hashlib.sha256(path.with_suffix(".csv").read_bytes()).hexdigest()
        assert (entry["seed"], entry["episode"], entry["signal"]) == (11, number, PLAIN.signals[number])
        episode, read = episode_of(PLAIN, number), read_episode(path)
        np.testing.assert_allclose(episode.bend, read.bend, rtol=1e-12)
        assert read.metadata == episode.metadata
        table = np.genfromtxt(path.with_suffix(".csv"), delimiter=",", names=True)
        np.testing.assert_allclose(table["pull_mm"], read.pull_mm, rtol=1e-12)
        np.testing.assert_allclose(table["bend_deg"], read.truth_deg, rtol=1e-12)
        np.testing.assert_allclose(table["tension_b_n"], read.tension[:, 1], rtol=1e-12)


def test_measurement_is_the_truth_with_the_noise_of_preset_and_recipe():
    episode = episode_of(changed(sensor_variance_deg2=0.0), 0)
    np.testing.assert_array_equal(episode.measured_bend, episode.bend)
    noisy = SMALL.replace(sensor_noise=float(np.radians(2.0)))
    for preset, variance, expected in ((SMALL, 4.0, 4.0), (noisy, 0.0, 4.0), (noisy, 5.0, 9.0)):
        episode = episode_of(changed(preset=preset, sensor_variance_deg2=variance, seconds=20.0), 0)
        assert (episode.measured_deg - episode.truth_deg).var() == pytest.approx(expected, rel=0.2)


def test_a_given_command_is_followed_by_every_episode():
    pull = np.linspace(0, 5e-4, 40)
    for number in range(2):
        episode = episode_of(changed(given_pull_m=tuple(pull.tolist()), seconds=0.8), number)
        np.testing.assert_array_equal(episode.pull, pull)
        assert episode.metadata["signal"] == "given"


def test_simulation_that_diverges_is_named_and_leaves_no_dataset_file_but_the_whole_episodes(tmp_path):
    recipe = changed(preset=FALLING, ranges=Ranges((("section_mass", 1e-4, 10.0),)))
    diverged = [episode is None for episode in make_episodes(recipe, recipe.keys)]
    first = diverged.index(True)
    line = f"episode {first} of seed 11: the simulation of 'small' diverged: narrow the ranges"
    with pytest.raises(FloatingPointError, match=line) as refused:
        make(tmp_path, recipe)
    assert "\n" not in str(refused.value)
    there = {path.name for path in tmp_path.iterdir()}
    whole = {f"episode_000{number}.mcap" for number in range(3) if not diverged[number]}
    assert len(whole) > 0
    assert there == {*whole, "recipe.yaml"}
    for name in whole:
        read_episode(tmp_path / name)
    with pytest.raises(FloatingPointError, match="diverged: lower time_step or the stiffness"):
        episode_of(changed(preset=FALLING), 0)


def test_every_episode_has_an_endoscope_of_its_own_within_the_ranges():
    drawn = [episode_of(RICH, number).metadata["preset"] for number in range(3)]
    for name, low, high in RANGES.limits:
        values = [preset[name] for preset in drawn]
        assert len(set(values)) == 3
        assert low <= min(values) <= max(values) <= high
        for preset in drawn:
            preset[name] = getattr(RICH.preset, name)
    wound = RICH.preset.replace(sheath_bend=float(np.radians(30.0)))  # where the wires are wound up
    assert drawn == [wound.to_dict()] * 3


def test_both_planes_are_pulled_within_their_strokes_while_the_sheath_is_bent_evenly():
    strokes = in_metres(RICH.strokes_mm[0]), in_metres(RICH.lateral_stroke_mm)
    for number in range(3):
        episode = episode_of(RICH, number)
        pulls = episode.pull, episode.lateral_pull
        for pull, (low, high) in zip(pulls, strokes, strict=True):
            assert low <= pull.min() < pull.max() <= high
        of_stroke = [np.interp(pull, stroke, (0, 1)) for pull, stroke in zip(pulls, strokes, strict=True)]
        assert np.abs(of_stroke[0] - of_stroke[1]).max() > 0.05  # two signals, not one on two scales
        evenly = np.radians(np.linspace(30, 170, len(episode.time)))
        np.testing.assert_allclose(episode.sheath_bend, evenly, rtol=1e-12)
        assert np.ptp(episode.lateral_bend) > 0


def test_what_is_added_to_a_recipe_leaves_the_signal_and_the_noise_as_they_were():
    plain = changed(PLAIN, seconds=RICH.seconds, sensor_variance_deg2=0.1)
    added = changed(RICH, ranges=Ranges(RANGES.limits[:2]), sensor_variance_deg2=0.1)
    one, other = episode_of(plain, 1), episode_of(added, 1)
    np.testing.assert_array_equal(other.pull, one.pull)
    differing = np.abs(other.wire_tension[:, :2] - one.wire_tension).max()
    assert differing > 0.1  # [N]; neither section moves
    np.testing.assert_allclose(other.measured_bend - other.bend, one.measured_bend - one.bend, atol=1e-15)


def test_sensor_is_the_one_that_was_drawn():
    for number in range(2):
        episode = episode_of(RICH, number)
        counts = episode.measured_bend / episode.metadata["preset"]["sensor_resolution"]
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
