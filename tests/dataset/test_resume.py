"""Generating again: only what is missing or damaged is made, the rest is not touched."""

import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import pytest
from small_dataset import NAMES, RECIPE, SECOND, changed, contents, identities, make

from twin.dataset import episodes as simulated_episode
from twin.dataset.episodes import make_episode
from twin.dataset.recipe import EpisodeKey
from twin.recording import read_episode, write_episode


def assert_only_made_anew(folder: Path, whole: Path, names: set[str], run: Callable[[], Any]) -> Any:
    """Run, and see that these files are new, all others untouched, and the folder is whole again."""
    before = identities(folder)
    result = run()
    after = identities(folder)
    assert {name for name in after if after[name] != before.get(name)} == names
    assert contents(folder) == contents(whole)
    return result


def test_whole_dataset_is_left_as_it_is(dataset_copy, whole_dataset):
    written = assert_only_made_anew(dataset_copy, whole_dataset, set(), lambda: make(dataset_copy, csv=True))
    assert written.kept == 3
    assert written.damage == ()
    assert written.contents == json.loads((whole_dataset / "dataset.json").read_text())


@pytest.mark.parametrize(
    ("names", "vouched"), [({SECOND}, True), ({NAMES[0], NAMES[2]}, False), (set(NAMES), True)]
)
def test_only_what_is_missing_is_made(dataset_copy, whole_dataset, names, vouched):
    for name in names:
        (dataset_copy / name).unlink()
    if not vouched:
        (dataset_copy / "dataset.json").unlink()
    written = assert_only_made_anew(dataset_copy, whole_dataset, names, lambda: make(dataset_copy, csv=True))
    assert written.kept == 3 - len(names)
    assert written.damage == ()


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


@pytest.mark.parametrize(
    ("damage", "what", "vouched"),
    [
        (flipped, "is damaged", True),
        (flipped, "is damaged", False),
        (lambda data: data[: len(data) // 2], "is cut off", False),
        (lambda data: b"", "is cut off: it is empty", True),
        (lambda data: b"not at all", "MCAP", False),
    ],
    ids=["bit", "bit, without dataset.json", "cut", "empty", "text"],
)
def test_damaged_file_is_made_anew_and_named(dataset_copy, whole_dataset, damage, what, vouched):
    (dataset_copy / SECOND).write_bytes(damage((dataset_copy / SECOND).read_bytes()))
    if not vouched:
        (dataset_copy / "dataset.json").unlink()
    written = assert_only_made_anew(
        dataset_copy, whole_dataset, {SECOND}, lambda: make(dataset_copy, csv=True)
    )
    assert written.kept == 2
    (line,) = written.damage
    assert str(dataset_copy / SECOND) in line
    assert what in line
    assert "\n" not in line


def test_whole_file_of_another_episode_is_made_anew(dataset_copy, whole_dataset):
    shutil.copy(dataset_copy / NAMES[0], dataset_copy / SECOND)
    written = assert_only_made_anew(
        dataset_copy, whole_dataset, {SECOND}, lambda: make(dataset_copy, csv=True)
    )
    assert written.damage == (f"{dataset_copy / SECOND}: episode is 0, not 1",)


def test_whole_file_of_another_recipe_is_made_anew(dataset_copy, whole_dataset):
    write_episode(dataset_copy / SECOND, make_episode(changed(sensor_variance_deg2=0.2), EpisodeKey(11, 1)))
    (dataset_copy / "dataset.json").unlink()
    written = assert_only_made_anew(
        dataset_copy, whole_dataset, {SECOND}, lambda: make(dataset_copy, csv=True)
    )
    (line,) = written.damage
    assert line.startswith(f"{dataset_copy / SECOND}: recipe_sha256 is ")


def test_whole_file_of_other_numbers_is_made_anew_where_dataset_json_tells(dataset_copy, whole_dataset):
    episode = read_episode(dataset_copy / SECOND)
    write_episode(dataset_copy / SECOND, dataclasses.replace(episode, bend=episode.bend + 0.1))
    written = assert_only_made_anew(
        dataset_copy, whole_dataset, {SECOND}, lambda: make(dataset_copy, csv=True)
    )
    assert written.damage == (f"{dataset_copy / SECOND} is not as dataset.json states",)


@pytest.mark.parametrize(("name", "version"), [("mujoco", "2.0.1"), ("endotwin", "0.0.1")])
def test_file_of_another_version_is_made_anew(dataset_copy, whole_dataset, name, version):
    episode = make_episode(RECIPE, EpisodeKey(11, 1))
    old = dataclasses.replace(episode, metadata=episode.metadata | {name: version})
    write_episode(dataset_copy / SECOND, old)
    (dataset_copy / "dataset.json").unlink()
    written = assert_only_made_anew(
        dataset_copy, whole_dataset, {SECOND}, lambda: make(dataset_copy, csv=True)
    )
    (line,) = written.damage
    assert line == f"{dataset_copy / SECOND}: {name} is {version}, not {episode.metadata[name]}"
    if name == "mujoco":
        assert line.endswith(mujoco.__version__)


def test_missing_or_changed_table_is_made_anew(dataset_copy, whole_dataset):
    (dataset_copy / "episode_0000.csv").unlink()
    table = dataset_copy / "episode_0002.csv"
    table.write_bytes(flipped(table.read_bytes()))
    # From the recording, whose numbers it holds: nothing is simulated again.
    written = assert_only_made_anew(dataset_copy, whole_dataset, set(), lambda: make(dataset_copy, csv=True))
    assert written.damage == (
        f"{dataset_copy / 'episode_0000.csv'} is missing",
        f"{table} is not as dataset.json states",
    )


def test_nothing_is_simulated_where_nothing_is_missing(dataset_copy, monkeypatch):
    def never(*arguments: Any, **options: Any) -> Any:
        raise AssertionError("simulated")

    monkeypatch.setattr(simulated_episode, "simulate_batch", never)
    assert make(dataset_copy, csv=True).kept == 3
    (dataset_copy / SECOND).unlink()
    with pytest.raises(AssertionError, match="simulated"):
        make(dataset_copy, csv=True)


def test_tables_are_added_to_a_dataset_without(whole_dataset, tmp_path):
    make(tmp_path)
    before = identities(tmp_path)
    assert make(tmp_path, csv=True).kept == 3
    assert identities(tmp_path) == before
    assert contents(tmp_path) == contents(whole_dataset)


def test_more_episodes_are_added_to_those_that_are_there(dataset_copy, tmp_path):
    before = identities(dataset_copy)
    written = make(dataset_copy, changed(episodes=5), csv=True)
    assert written.kept == 3
    after = identities(dataset_copy)
    assert {name: after[name] for name in before} == before
    make(tmp_path / "at_once", changed(episodes=5), csv=True)
    assert contents(dataset_copy) == contents(tmp_path / "at_once")


def test_more_seeds_are_added_to_those_that_are_there(tmp_path):
    make(tmp_path / "grown", changed(episodes=1, seeds=(1, 2)))
    before = identities(tmp_path / "grown")
    written = make(tmp_path / "grown", changed(episodes=1, seeds=(1, 2, 3)))
    assert written.kept == 2
    assert {name: identities(tmp_path / "grown")[name] for name in before} == before
    make(tmp_path / "at_once", changed(episodes=1, seeds=(1, 2, 3)))
    assert contents(tmp_path / "grown") == contents(tmp_path / "at_once")
