"""Verifying finds whatever is wrong with a dataset of each kind: its files, its tables, its dataset.json."""

import copy
import dataclasses
import json
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_dataset import SECOND, SMALL, TWO_PLANES, changed, flip, make, measured_log

from scripts.generate import main
from twin.dataset.verify import verify
from twin.dataset.write import describe
from twin.evaluation import scenarios
from twin.files.bounded import sha256_of
from twin.files.dataset_json import SimulatedRecipe, read_contents, to_json_values
from twin.measured.folder import write_measured
from twin.preset.randomization import Ranges
from twin.recording import read_episode, write_episode
from twin.rendering.camera import Camera

RANGES = Ranges((("pretension", 1.0, 6.0), ("sensor_noise", 0.001, 0.01)))


def edit(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change the contents of `dataset.json`."""
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


def second(**changes: Any) -> Callable[[Path], None]:
    """Change the entry of the second file."""
    return lambda folder: edit(folder, lambda contents: contents["files"][1].update(changes))


def bend_of_second(**changes: Any) -> Callable[[Path], None]:
    """Change its statistics of the bend."""

    def change(contents: dict[str, Any]) -> None:
        contents["files"][1]["statistics"]["truth_deg"].update(changes)

    return lambda folder: edit(folder, change)


def all_of(change: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    return lambda folder: edit(folder, change)


def rewritten(**changes: Callable[[Any], Any]) -> Callable[[Path], None]:
    """Write the second file with other numbers, its CRCs right and its hash in `dataset.json`."""

    def change(folder: Path) -> None:
        episode = read_episode(folder / SECOND)
        values = {name: of(getattr(episode, name)) for name, of in changes.items()}
        write_episode(folder / SECOND, dataclasses.replace(episode, **values))
        adopt(folder)

    return change


def cut(folder: Path) -> None:
    (folder / SECOND).write_bytes((folder / SECOND).read_bytes()[:5000])
    adopt(folder)


BREAKS: list[tuple[str, Callable[[Path], Any], str]] = [
    ("files", lambda folder: (folder / SECOND).unlink(), f"{SECOND} is missing"),
    ("files", lambda folder: shutil.copy(folder / SECOND, folder / "a.mcap"), "a.mcap is not in"),
    ("bytes", second(sha256="0" * 64), f"{SECOND} has another SHA-256 than dataset.json states"),
    ("bytes", second(bytes=9), ", dataset.json states 9"),
    ("readable", cut, "is cut off"),
    ("length", second(samples=51), f"{SECOND} has 50 samples, dataset.json states 51"),
    ("length", second(seconds=1.02), f"{SECOND} lasts 1 s, dataset.json states 1.02 s"),
    ("quantities", all_of(lambda c: c["features"].pop("wire_tension_n")), "holds other quantities than"),
    ("quantities", all_of(lambda c: c["features"]["truth_deg"].update(meaning="x")), "holds other quant"),
    ("statistics", bend_of_second(mean=99.0), ": mean of truth_deg is "),
    ("statistics", bend_of_second(count=49), ": count of truth_deg is 50"),
    ("statistics", rewritten(bend=lambda bend: bend + 0.1), " of truth_deg is "),
    (
        "statistics",
        rewritten(measured_bend=lambda bend: np.where(np.arange(50) < 25, np.nan, bend)),
        ": count of measured_deg is 25, not 50, by dataset.json",
    ),
    ("origin", second(signal="sawtooth"), ": signal is decaying-sine, dataset.json states sawtooth"),
    ("origin", second(seed=12), ": seed is 11, dataset.json states 12"),
    ("origin", all_of(lambda c: c.update(mujoco="2.0.1")), "dataset.json states 2.0.1"),
    ("recipe", lambda folder: (folder / "recipe.yaml").unlink(), "recipe.yaml is missing"),
    ("recipe", all_of(lambda c: c["recipe"]["preset"].update(pretension=4.0)), "is another recipe than"),
    ("recipe", all_of(lambda c: c["files"].reverse()), "its files are not the episodes of the recipe"),
    ("totals", all_of(lambda c: c.update(seconds=1e3)), "seconds of the dataset do not follow"),
    ("totals", all_of(lambda c: c.update(episodes=4)), "episodes of the dataset do not follow"),
    ("totals", all_of(lambda c: c["statistics"]["pull_mm"].update(mean=9)), "statistics of the dataset do"),
    ("tables", lambda folder: flip(folder / "episode_0002.csv", 0.5), "episode_0002.csv has another SHA-256"),
    ("tables", lambda folder: (folder / "episode_0002.csv").unlink(), "episode_0002.csv is missing"),
    ("card", lambda folder: (folder / "README.md").unlink(), "README.md is missing"),
    ("card", lambda folder: (folder / "loops.png").unlink(), "loops.png is missing"),
]


@pytest.mark.parametrize(("rule", "damage", "line"), BREAKS)
def test_what_breaks_a_rule_is_found_in_one_line_with_the_rule(dataset_copy, rule, damage, line):
    damage(dataset_copy)
    faults, count = verify(dataset_copy)
    assert count == 3
    assert any(fault.rule == rule and line in fault for fault in faults), faults
    assert not [fault for fault in faults if "\n" in fault]


def test_whole_dataset_has_no_fault_and_progress_is_reported(whole_dataset):
    counts: list[tuple[int, int]] = []
    assert verify(whole_dataset, on_progress=lambda *count: counts.append(count)) == ([], 3)
    assert counts == [(1, 3), (2, 3), (3, 3)]


@pytest.mark.parametrize("place", [0.001, 0.5, 0.9999])
def test_flipped_bit_is_found_even_if_the_hash_is_changed_with_it(dataset_copy, place):
    flip(dataset_copy / SECOND, place)
    assert str(dataset_copy / SECOND) in verify(dataset_copy)[0][0]
    adopt(dataset_copy)
    (fault,), _ = verify(dataset_copy)
    assert re.search("damaged|not an MCAP file|cut off", fault)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"files": [3]}', '{"files": [{"name": 3}]}', "\xff"])
def test_damaged_dataset_file_is_refused_in_one_line_with_what_to_do(dataset_copy, text):
    (dataset_copy / "dataset.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(ValueError, match=r"^[^\n]*dataset\.json is damaged .*remove it, and generate"):
        verify(dataset_copy)
    (dataset_copy / "dataset.json").unlink()
    with pytest.raises(FileNotFoundError, match=r"no .*dataset\.json: the dataset is not complete"):
        verify(dataset_copy)


def simulated(folder: Path) -> None:
    """With everything that a recipe can ask for but a camera, which needs OpenGL."""
    recipe = changed(
        preset=TWO_PLANES.replace(sensor_period=0.04),
        lateral_stroke_mm=(0.2, 0.8),
        sheath_bends_deg=((30.0, 170.0),),
        ranges=RANGES,
        seconds=0.1,
        episodes=1,
        seeds=(1, 2),
    )
    make(folder, recipe, csv=True)


def measured(folder: Path) -> None:
    logs = folder.with_name("logs")
    logs.mkdir()
    for name in ("first", "second"):
        write_measured(folder, name, measured_log(logs))


def benchmark(folder: Path) -> None:
    """With one stroke, one signal and one randomised twin."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenarios, "STROKES_MM", scenarios.STROKES_MM[:1])
        patch.setattr(scenarios, "SIGNALS", list(scenarios.SIGNALS)[:1])
        patch.setattr(scenarios, "RANDOMIZED", 1)
        scenarios.write_scenarios(folder, SMALL, RANGES, 0.1, seed=1)


@pytest.fixture(scope="module", params=[simulated, measured, benchmark], ids=lambda writer: writer.__name__)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param.__name__) / "data"
    folder.mkdir()
    request.param(folder)
    return folder


def test_every_writer_states_its_kind_and_is_whole(written, capsys):
    assert read_contents(written).source == written.parent.name.rstrip("0123456789")
    assert main(["--verify", "--out", str(written)]) == 0
    assert "episodes are complete" in capsys.readouterr().out


def places(part: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every key and index in JSON values, with where it is."""
    for key in list(part) if isinstance(part, dict) else range(len(part)):
        yield (*place, key)
        if isinstance(part[key], dict | list):
            yield from places(part[key], (*place, key))


def test_any_item_removed_or_of_another_type_and_any_key_added_is_noticed(written, tmp_path):
    folder = Path(shutil.copytree(written, tmp_path / "data"))
    whole = json.loads((folder / "dataset.json").read_text())
    found = [*places(whole)]
    assert len(found) > 50
    rng = np.random.default_rng(0)
    for k in rng.choice(len(found), 50, replace=False):
        *inside, key = found[k]
        for action in ("remove", "change", "add"):
            contents = copy.deepcopy(whole)
            part = contents
            for one in inside:
                part = part[one]
            if action == "remove":
                part.pop(key)
            elif action == "change":
                part[key] = "three" if isinstance(part[key], int | float) else 3.5
            elif isinstance(part, dict):
                part["colour"] = 1
            else:
                continue
            (folder / "dataset.json").write_text(json.dumps(contents))
            try:
                noticed = verify(folder)[0]
            except ValueError as error:
                noticed = [str(error)]
            assert noticed, (action, found[k])
            assert not [line for line in noticed if "\n" in line]


def test_record_of_another_preset_or_outside_the_ranges_is_found(tmp_path):
    benchmark(tmp_path)
    whole = json.loads((tmp_path / "dataset.json").read_text())
    for name, change in (("preset", {"wire_stiffness": 9e3}), ("ranges", {"pretension": [6.5, 7.0]})):
        contents = copy.deepcopy(whole)
        contents["recipe"][name].update(change)
        (tmp_path / "dataset.json").write_text(json.dumps(contents))
        assert any(next(iter(change)) in line for line in verify(tmp_path)[0])


def test_recipe_with_a_camera_and_a_given_command_fits_the_schema():
    given = (0.0, 1e-3)
    recipe = changed(
        camera=Camera(10, 320, 240), given_pull_m=given, given_lateral_pull_m=given, physics="reduced"
    )
    described = describe(recipe)
    assert {"camera", "given_pull_m", "given_lateral_pull_m", "physics"} <= set(described)
    assert described["given_lateral_pull_m"] == "2 samples: see recipe.yaml"
    assert to_json_values(SimulatedRecipe.model_validate_json(json.dumps(described))) == described
