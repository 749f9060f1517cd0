"""Verifying finds whatever is wrong with a dataset: its files, its tables, what is said of them."""

import dataclasses
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_dataset import SECOND, TWO_PLANES, changed, flip, make, measured_log

from twin.dataset.verify import verify
from twin.files.bounded import sha256_of
from twin.measured.folder import write_measured
from twin.preset.randomization import Ranges
from twin.recording import read_episode, write_episode

OTHER_HASH = f"{SECOND} has another SHA-256 than dataset.json states"


def edit(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change what `dataset.json` says."""
    path = folder / "dataset.json"
    contents = json.loads(path.read_text())
    change(contents)
    path.write_text(json.dumps(contents))


def adopt(folder: Path) -> None:
    """Let `dataset.json` state hash and size of the second file as it is now."""
    path = folder / SECOND

    def change(contents: dict[str, Any]) -> None:
        contents["bytes"] += path.stat().st_size - contents["files"][1]["bytes"]
        contents["files"][1].update(sha256=sha256_of(path), bytes=path.stat().st_size)

    edit(folder, change)


def faults_of(folder: Path, count: int = 1) -> list[str]:
    """The faults, of which there are so many, each in one line."""
    faults, episodes = verify(folder)
    assert episodes == 3
    assert len(faults) == count, faults
    assert not [fault for fault in faults if "\n" in fault]
    return faults


def test_missing_recipe_is_a_fault(tmp_path):
    make(tmp_path)
    (tmp_path / "recipe.yaml").unlink()
    assert verify(tmp_path)[0] == [f"{tmp_path / 'recipe.yaml'} is missing"]


def test_whole_dataset_has_no_fault_and_progress_is_told(whole_dataset):
    told: list[tuple[int, int]] = []
    assert verify(whole_dataset, on_progress=lambda *counts: told.append(counts)) == ([], 3)
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_dataset_of_drawn_endoscopes_with_two_planes_has_no_fault(tmp_path):
    recipe = changed(
        preset=TWO_PLANES.replace(sensor_period=0.04),
        lateral_stroke_mm=(0.2, 0.8),
        sheath_bends_deg=((30.0, 170.0), (0.0, 0.0)),
        ranges=Ranges((("pretension", 1.0, 6.0),)),
        seeds=(1, 2),
    )
    make(tmp_path, recipe)
    assert verify(tmp_path) == ([], 6)


def test_missing_file_is_found(dataset_copy):
    (dataset_copy / SECOND).unlink()
    assert faults_of(dataset_copy) == [f"{dataset_copy / SECOND} is missing"]


def test_foreign_file_is_found(dataset_copy):
    shutil.copy(dataset_copy / SECOND, dataset_copy / "foreign.mcap")
    assert faults_of(dataset_copy) == [f"{dataset_copy / 'foreign.mcap'} is not in dataset.json"]


def test_other_hash_is_found(dataset_copy):
    edit(dataset_copy, lambda contents: contents["files"][1].update(sha256="0" * 64))
    (fault,) = faults_of(dataset_copy)
    assert fault.endswith(OTHER_HASH)


@pytest.mark.parametrize("place", [0.001, 0.1, 0.5, 0.9, 0.9999])
def test_flipped_bit_is_found_even_if_the_hash_is_changed_with_it(dataset_copy, place):
    flip(dataset_copy / SECOND, place)
    assert str(dataset_copy / SECOND) in verify(dataset_copy)[0][0]
    adopt(dataset_copy)
    (fault,) = faults_of(dataset_copy)
    assert str(dataset_copy / SECOND) in fault
    assert "damaged" in fault or "not an MCAP file" in fault or "cut off" in fault


def test_cut_file_is_found(dataset_copy):
    data = (dataset_copy / SECOND).read_bytes()
    (dataset_copy / SECOND).write_bytes(data[: len(data) // 2])
    (cut,) = faults_of(dataset_copy)
    assert "is cut off" in cut


def test_changed_or_missing_table_is_found(dataset_copy):
    table = dataset_copy / "episode_0002.csv"
    flip(table, 0.5)
    assert faults_of(dataset_copy) == [f"{table} has another SHA-256 than dataset.json states"]
    table.unlink()
    assert faults_of(dataset_copy) == [f"{table} is missing"]


@pytest.mark.parametrize("key", ["min", "max", "mean", "std", "count"])
def test_wrong_statistics_of_a_file_are_found(dataset_copy, key):
    def change(contents: dict[str, Any]) -> None:
        contents["files"][1]["statistics"]["truth_deg"][key] += 1

    edit(dataset_copy, change)
    faults, _ = verify(dataset_copy)
    assert faults[0].startswith(f"{dataset_copy / SECOND}: {key} of truth_deg is ")


@pytest.mark.parametrize("name", ["episodes", "seconds", "bytes", "statistics"])
def test_wrong_total_is_found(dataset_copy, name):
    def change(contents: dict[str, Any]) -> None:
        if name == "statistics":
            contents["statistics"]["pull_mm"]["mean"] *= 1.001
        else:
            contents[name] += 1

    edit(dataset_copy, change)
    (fault,) = faults_of(dataset_copy)
    assert fault == f"{dataset_copy / 'dataset.json'}: {name} of the dataset do not follow from its files"


def test_other_numbers_in_a_whole_file_are_found(dataset_copy):
    """With its CRCs right and its hash in dataset.json: only the numbers tell."""
    episode = read_episode(dataset_copy / SECOND)
    bend = episode.bend.copy()
    bend[7] += 10.0
    write_episode(dataset_copy / SECOND, dataclasses.replace(episode, bend=bend))
    adopt(dataset_copy)
    faults, _ = verify(dataset_copy)
    assert faults
    assert all(f"{dataset_copy / SECOND}: " in fault and " of truth_deg is " in fault for fault in faults)


def test_measurements_that_have_gone_missing_are_found(dataset_copy):
    episode = read_episode(dataset_copy / SECOND)
    blind = np.where(np.arange(len(episode.time)) < 25, np.nan, episode.measured_bend)
    write_episode(dataset_copy / SECOND, dataclasses.replace(episode, measured_bend=blind))
    adopt(dataset_copy)
    faults, _ = verify(dataset_copy)
    assert f"{dataset_copy / SECOND}: count of measured_deg is 25, not 50, by dataset.json" in faults


def test_wrong_number_of_samples_is_found(dataset_copy):
    edit(dataset_copy, lambda contents: contents["files"][1].update(samples=51))
    faults = faults_of(dataset_copy, 2)
    assert faults[0] == f"{dataset_copy / SECOND} has 50 samples, dataset.json states 51"
    assert faults[1] == f"{dataset_copy / SECOND}: samples is 50, dataset.json states 51"


def test_wrong_length_of_a_file_is_found(dataset_copy):
    edit(dataset_copy, lambda contents: contents["files"][1].update(seconds=1.02))
    faults = faults_of(dataset_copy, 2)
    assert faults[0] == f"{dataset_copy / SECOND} lasts 1 s, dataset.json states 1.02 s"
    assert "seconds of the dataset" in faults[1]


def test_wrong_size_of_a_file_is_found(dataset_copy):
    size = (dataset_copy / SECOND).stat().st_size
    edit(dataset_copy, lambda contents: contents["files"][1].update(bytes=size + 1))
    faults = faults_of(dataset_copy, 2)
    assert faults[0] == f"{dataset_copy / SECOND} has {size} bytes, dataset.json states {size + 1}"
    assert "bytes of the dataset" in faults[1]


def test_other_quantities_are_found(dataset_copy):
    edit(dataset_copy, lambda contents: contents["features"].pop("wire_tension_n"))
    *of_files, of_all = faults_of(dataset_copy, 4)
    assert {fault.rpartition("mcap ")[2] for fault in of_files} == {
        "holds other quantities than dataset.json states"
    }
    assert "features of the dataset do not follow from its files" in of_all


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "null", "{}", '{"files": 3}', '{"files": [3]}', '{"files": [{"name": 3}]}', "\xff"],
)
def test_damaged_dataset_file_is_said_in_one_line_with_what_to_do(dataset_copy, text):
    (dataset_copy / "dataset.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(ValueError, match=r"dataset\.json is damaged .*remove it, and generate") as refused:
        verify(dataset_copy)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda entry: entry.pop("sha256"), "files[1].sha256 is missing"),
        (lambda entry: entry.update(statistics=5), "files[1].statistics = 5: must be an object"),
        (lambda entry: entry["statistics"].update(truth_deg=5), "files[1].statistics.truth_deg = 5: must be"),
        (
            lambda entry: entry["statistics"]["truth_deg"].update(mean="five"),
            "files[1].statistics.truth_deg.mean = 'five': must be a valid number",
        ),
    ],
)
def test_entry_that_does_not_fit_the_schema_is_refused(dataset_copy, change, fault):
    edit(dataset_copy, lambda contents: change(contents["files"][1]))
    with pytest.raises(ValueError, match=re.escape(fault)):
        verify(dataset_copy)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (
            lambda entry: entry["statistics"].pop("truth_deg"),
            ": statistics are of other quantities, by dataset.json",
        ),
        (
            lambda entry: entry["statistics"]["truth_deg"].update(count=49),
            ": count of truth_deg is 50",
        ),
        (
            lambda entry: entry.update(signal="sawtooth"),
            ": signal is decaying-sine, dataset.json states sawtooth",
        ),
        (lambda entry: entry.update(seed=12), ": seed is 11, dataset.json states 12"),
    ],
)
def test_wrong_entry_is_a_fault(dataset_copy, change, fault):
    edit(dataset_copy, lambda contents: change(contents["files"][1]))
    faults, _ = verify(dataset_copy)
    assert any(line.startswith(f"{dataset_copy / SECOND}{fault}") for line in faults)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda contents: contents["recipe"]["preset"].update(pretension=4.0), "is another recipe than"),
        (lambda contents: contents.update(mujoco="2.0.1"), "dataset.json states 2.0.1"),
        (lambda contents: contents["files"].reverse(), "its files are not the episodes of the recipe"),
        (
            lambda contents: contents["files"][0]["statistics"]["truth_deg"].update(count=1),
            "of the dataset",
        ),
    ],
)
def test_what_dataset_json_says_of_the_whole_is_compared(dataset_copy, change, fault):
    edit(dataset_copy, change)
    faults, _ = verify(dataset_copy)
    assert any(fault in line for line in faults)


def test_recipe_of_another_dataset_is_a_fault(dataset_copy):
    path = dataset_copy / "recipe.yaml"
    path.write_text(path.read_text().replace("seconds: 1.0", "seconds: 2.0"))
    assert f"{path} is another recipe than dataset.json states" in verify(dataset_copy)[0]


def test_file_outside_the_folder_is_not_followed(dataset_copy):
    edit(dataset_copy, lambda contents: contents["files"][1].update(name="../a.mcap"))
    with pytest.raises(ValueError, match=r"dataset\.json is damaged"):
        verify(dataset_copy)


def test_folder_without_a_dataset_file_is_refused(dataset_copy):
    (dataset_copy / "dataset.json").unlink()
    with pytest.raises(FileNotFoundError, match=r"no .*dataset\.json: the dataset is not complete"):
        verify(dataset_copy)


def test_measured_dataset_is_verified_too(tmp_path):
    (tmp_path / "data").mkdir()
    for name in ("first", "second"):
        write_measured(tmp_path / "data", name, measured_log(tmp_path))
    assert verify(tmp_path / "data") == ([], 2)
    flip(tmp_path / "data" / "first.mcap", 0.5)
    faults, episodes = verify(tmp_path / "data")
    assert episodes == 2
    assert "first.mcap is damaged" in faults[0]


@pytest.mark.parametrize("name", ["README.md", "loops.png"])
def test_missing_card_is_a_fault(dataset_copy, name):
    (dataset_copy / name).unlink()
    assert faults_of(dataset_copy) == [f"{dataset_copy / name} is missing"]


def test_folder_that_is_not_there_is_said(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no folder .*nothing"):
        verify(tmp_path / "nothing")
