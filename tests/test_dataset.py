import hashlib
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from twin.dataset import Recipe, make_episode, write_dataset
from twin.preset import load_preset
from twin.recording import read_dataset, read_episode


@pytest.fixture(scope="module")
def recipe():
    preset = load_preset("ureteroscope").replace(vertebrae=6, sheath_elements=2)
    return Recipe(preset, (-1e-3, 1e-3), seconds=2.0, seed=11)


def processes(count):
    return ProcessPoolExecutor(count, multiprocessing.get_context("spawn"))


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def folder(recipe, tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    with processes(1) as executor:
        write_dataset(recipe, 3, folder, executor, csv=True)
    return folder


def test_same_seed_gives_the_same_bytes_whatever_the_number_of_workers(recipe, folder, tmp_path):
    with processes(2) as executor:
        write_dataset(recipe, 3, tmp_path, executor, csv=True)
    assert contents(tmp_path) == contents(folder)


def test_an_episode_does_not_depend_on_how_many_there_are(recipe, folder):
    episode = make_episode(recipe, 2)
    np.testing.assert_allclose(episode.bend, read_episode(folder / "episode_0002.mcap").bend, rtol=1e-12)


def test_another_seed_gives_another_signal_and_noise(recipe):
    one, other = make_episode(recipe, 0), make_episode(Recipe(**{**vars(recipe), "seed": 12}), 0)
    assert not np.array_equal(one.pull, other.pull)
    assert not np.array_equal(one.measured_bend - one.bend, other.measured_bend - other.bend)


def test_dataset_file_vouches_for_every_episode(recipe, folder):
    described = json.loads((folder / "dataset.json").read_text())
    assert described["stroke_mm"] == [-1, 1]
    assert described["preset"]["vertebrae"] == 6
    for number, entry in enumerate(described["files"]):
        data = (folder / entry["name"]).read_bytes()
        assert entry["sha256"] == hashlib.sha256(data).hexdigest()
        assert entry["name"] == f"episode_{number:04d}.mcap"
        assert entry["samples"] == 100


def test_measurement_is_the_truth_with_the_noise_of_the_sensor(recipe):
    quiet = Recipe(**{**vars(recipe), "sensor_variance_deg2": 0.0})
    episode = make_episode(quiet, 0)
    np.testing.assert_array_equal(episode.measured_bend, episode.bend)
    noisy = Recipe(**{**vars(recipe), "sensor_variance_deg2": 4.0, "seconds": 20.0})
    episode = make_episode(noisy, 0)
    assert (episode.measured_bend_deg - episode.bend_deg).var() == pytest.approx(4.0, rel=0.2)


def test_table_beside_the_recording_holds_the_same_numbers(folder):
    episode = read_dataset(folder)[1]
    table = np.genfromtxt(folder / "episode_0001.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["pull_mm"], episode.pull_mm, rtol=1e-12)
    np.testing.assert_allclose(table["bend_deg"], episode.bend_deg, rtol=1e-12)
    np.testing.assert_allclose(table["tension_b_n"], episode.tension[:, 1], rtol=1e-12)


def test_a_given_command_is_followed(recipe):
    pull = np.linspace(0, 5e-4, 40)
    episode = make_episode(Recipe(**{**vars(recipe), "given_command": tuple(pull)}), 0)
    np.testing.assert_array_equal(episode.pull, pull)
    assert episode.metadata["signal"] == "given"


def test_a_failing_episode_leaves_no_dataset_file(recipe, tmp_path):
    broken = Recipe(**{**vars(recipe), "signals": ("sine", "no-such-signal")})
    with ThreadPoolExecutor(1) as executor, pytest.raises(ValueError, match="no-such-signal"):
        write_dataset(broken, 2, tmp_path, executor)
    assert not (tmp_path / "dataset.json").exists()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stroke": (1e-3, 1e-3)}, r"stroke \[1, 1\] mm"),
        ({"seconds": 0.0}, "at least two samples"),
        ({"sample_time": 0.015}, "whole multiple of the control period"),
        ({"sensor_variance_deg2": -1.0}, "not negative"),
        ({"signals": ("sinus",)}, "unknown signal 'sinus'; valid: sine"),
        ({"seed": -1}, "seed = -1"),
    ],
)
def test_recipe_that_cannot_be_made_is_refused_before_any_work(recipe, change, message):
    with pytest.raises(ValueError, match=message):
        Recipe(**{**vars(recipe), **change}).check()
