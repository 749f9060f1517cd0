"""Datasets: the same bytes whoever makes them, episodes that follow their recipe, errors before any work."""

import dataclasses
import hashlib
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from twin.dataset import Recipe, make_episode, write_dataset
from twin.preset import Preset
from twin.randomization import Ranges
from twin.recording import read_dataset, read_episode
from twin.sensor import measure

SMALL = Preset(
    "small",
    vertebrae=6,
    section_stiffness=0.05,
    joint_friction=1e-3,
    wire_offset=1.3e-3,
    wire_stiffness=8e3,
    pretension=3.0,
    sheath_elements=2,
    time_step=2.5e-3,
    control_period=1e-2,
)
TWO_PLANES = SMALL.replace(bending_planes=2)
RANGES = Ranges(
    (("pretension", 1.0, 6.0), ("section_stiffness", 0.03, 0.05), ("sensor_resolution", 1e-3, 1e-2))
)


@pytest.fixture(scope="module")
def recipe():
    return Recipe(SMALL, (-1e-3, 1e-3), seconds=2.0, seed=11)


@pytest.fixture(scope="module")
def rich(recipe):
    """A recipe with two planes, a sheath that is being bent, and an endoscope of its own for each episode."""
    return changed(
        recipe,
        preset=TWO_PLANES,
        lateral_stroke=(0.2e-3, 0.8e-3),
        sheath_bend=(0.5, 3.0),
        ranges=RANGES,
        seconds=1.0,
        sensor_variance_deg2=0.0,
    )


def changed(recipe, **changes):
    return dataclasses.replace(recipe, **changes)


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
    one, other = make_episode(recipe, 0), make_episode(changed(recipe, seed=12), 0)
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
    quiet = changed(recipe, sensor_variance_deg2=0.0)
    episode = make_episode(quiet, 0)
    np.testing.assert_array_equal(episode.measured_bend, episode.bend)
    noisy = changed(recipe, sensor_variance_deg2=4.0, seconds=20.0)
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
    episode = make_episode(changed(recipe, given_command=tuple(pull)), 0)
    np.testing.assert_array_equal(episode.pull, pull)
    assert episode.metadata["signal"] == "given"


def test_a_failing_episode_leaves_no_dataset_file(recipe, tmp_path):
    broken = changed(recipe, signals=("sine", "no-such-signal"))
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
        ({"stroke": (0.0, np.nan)}, r"stroke \[0, nan\] mm: this endoscope is pulled by at most"),
        ({"stroke": (0.0, 0.05)}, r"stroke \[0, 50\] mm: this endoscope is pulled by at most 8\.17 mm"),
        ({"lateral_stroke": (0.0, 1e-3)}, "'small' has one bending plane, it needs two"),
        (
            {"preset": TWO_PLANES, "lateral_stroke": (1e-3, 0.0)},
            r"stroke \[1, 0\] mm: the first must be below",
        ),
        ({"preset": TWO_PLANES, "lateral_stroke": (-0.05, 0.0)}, r"stroke \[-50, 0\] mm: this endoscope is"),
        ({"sheath_bend": (0.0, -0.1)}, r"bend of the sheath -5\.72958 deg: must be from 0 to 1440 deg"),
        ({"sheath_bend": (30.0, 0.0)}, r"bend of the sheath 1718\.87 deg: must be from 0 to 1440 deg"),
        ({"sheath_bend": (0.0, np.nan)}, "bend of the sheath nan deg: must be from 0"),
    ],
)
def test_recipe_that_cannot_be_made_is_refused_before_any_work_in_one_line(recipe, change, message):
    with pytest.raises(ValueError, match=message) as refused:
        changed(recipe, **change).check()
    assert "\n" not in str(refused.value)


def test_recipe_that_can_be_made_is_not_refused(recipe, rich):
    recipe.check()
    rich.check()


def test_episode_of_a_rich_recipe_does_not_depend_on_how_many_there_are(rich, tmp_path):
    with ThreadPoolExecutor(1) as executor:
        few = write_dataset(rich, 2, tmp_path / "few", executor)
        many = write_dataset(rich, 3, tmp_path / "many", executor)
    assert many["files"][:2] == few["files"]
    assert len({entry["sha256"] for entry in many["files"]}) == 3
    assert (
        make_episode(rich, 1).metadata["preset"]
        == read_episode(tmp_path / "many" / "episode_0001.mcap").metadata["preset"]
    )


def test_dataset_file_describes_a_rich_recipe(rich, tmp_path):
    with ThreadPoolExecutor(1) as executor:
        write_dataset(rich, 1, tmp_path, executor)
    described = json.loads((tmp_path / "dataset.json").read_text())
    assert described["lateral_stroke_mm"] == [0.2, 0.8]
    assert described["sheath_bend_deg"] == pytest.approx(np.degrees([0.5, 3.0]))
    assert described["ranges"] == RANGES.to_dict()
    assert described["preset"] == rich.preset.to_dict()


def test_every_episode_has_an_endoscope_of_its_own_within_the_ranges(rich):
    drawn = [make_episode(rich, number).metadata["preset"] for number in range(3)]
    for name, low, high in RANGES.limits:
        values = [preset[name] for preset in drawn]
        assert len(set(values)) == 3
        assert low <= min(values) <= max(values) <= high
        for preset in drawn:
            preset[name] = getattr(rich.preset, name)
    assert drawn == [rich.preset.to_dict()] * 3


def test_both_planes_are_pulled_within_their_strokes_while_the_sheath_is_bent_evenly(rich):
    for number in range(3):
        episode = make_episode(rich, number)
        assert rich.stroke[0] <= episode.pull.min() < episode.pull.max() <= rich.stroke[1]
        lateral = episode.lateral_pull
        assert rich.lateral_stroke[0] <= lateral.min() < lateral.max() <= rich.lateral_stroke[1]
        of_stroke = [
            np.interp(pull, stroke, (0, 1))
            for pull, stroke in ((episode.pull, rich.stroke), (lateral, rich.lateral_stroke))
        ]
        assert np.abs(of_stroke[0] - of_stroke[1]).max() > 0.05  # two signals, not one on two scales
        np.testing.assert_allclose(episode.sheath_bend, np.linspace(0.5, 3.0, len(episode.time)))
        assert np.ptp(episode.lateral_bend) > 0


def test_what_is_added_to_a_recipe_leaves_the_signal_and_the_noise_as_they_were(recipe, rich):
    plain = changed(recipe, seconds=rich.seconds, sensor_variance_deg2=0.1)
    added = changed(rich, ranges=Ranges(RANGES.limits[:2]), sensor_variance_deg2=0.1)
    one, other = make_episode(plain, 1), make_episode(added, 1)
    np.testing.assert_array_equal(other.pull, one.pull)
    assert np.abs(other.bend - one.bend).max() > 1e-4
    np.testing.assert_allclose(other.measured_bend - other.bend, one.measured_bend - one.bend, atol=1e-15)


def test_sensor_of_the_preset_measures(recipe):
    sensor = {"sensor_period": 0.04, "sensor_latency": 0.06, "sensor_resolution": 1e-3}
    episode = make_episode(changed(recipe, preset=SMALL.replace(**sensor), sensor_variance_deg2=0.0), 0)
    last = np.maximum(
        (np.arange(len(episode.time)) - 3) // 2, 0
    )  # reading that is three samples old or older
    late = episode.bend[2 * last]
    np.testing.assert_allclose(episode.measured_bend, 1e-3 * np.round(late / 1e-3), atol=1e-12)
    np.testing.assert_array_equal(
        episode.measured_bend,
        measure(SMALL.replace(**sensor), episode.time, episode.bend, np.random.default_rng(0)),
    )


def test_noise_of_the_preset_and_of_the_recipe_add_up(recipe):
    noisy = SMALL.replace(sensor_noise=float(np.radians(2.0)))
    for variance, expected in ((0.0, 4.0), (5.0, 9.0)):
        episode = make_episode(changed(recipe, preset=noisy, sensor_variance_deg2=variance, seconds=20.0), 0)
        assert (episode.measured_bend_deg - episode.bend_deg).var() == pytest.approx(expected, rel=0.2)


def test_sensor_is_the_one_that_was_drawn(rich):
    for number in range(2):
        episode = make_episode(rich, number)
        counts = episode.measured_bend / episode.metadata["preset"]["sensor_resolution"]
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
