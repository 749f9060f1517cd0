"""One `dataset.json` for three writers: whole as written, at fault with any key removed, added or changed."""

import copy
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from small_dataset import SMALL, TWO_PLANES, changed, make, measured_log

from scripts.generate import main
from twin.dataset.verify import verify
from twin.dataset.write import describe
from twin.evaluation import scenarios
from twin.files.dataset_json import KINDS, SimulatedRecipe, read_contents, to_json_values
from twin.measured.folder import write_measured
from twin.preset.randomization import Ranges
from twin.rendering.camera import Camera

RANGES = Ranges((("pretension", 1.0, 6.0), ("sensor_noise", 0.001, 0.01)))


def simulated(folder: Path) -> None:
    """With everything that a recipe can ask for but a camera, which needs OpenGL."""
    recipe = changed(
        preset=TWO_PLANES,
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


@pytest.fixture
def folder(written: Path, tmp_path: Path) -> Path:
    """A copy, to be changed."""
    return Path(shutil.copytree(written, tmp_path / "data"))


def containers(part: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Every object and list in JSON values, with where it is."""
    if isinstance(part, (dict, list)):
        yield place, part
        for key, value in part.items() if isinstance(part, dict) else enumerate(part):
            yield from containers(value, (*place, key))


def at(values: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        values = values[key]
    return values


def faults_with(folder: Path, contents: Any) -> list[str]:
    """Return the faults of a dataset whose `dataset.json` is replaced, or the lines of its refusal."""
    (folder / "dataset.json").write_text(json.dumps(contents))
    try:
        lines = verify(folder)[0]
    except ValueError as error:
        lines = [str(error)]
    assert not [line for line in lines if "\n" in line]
    return lines


def unnoticed(folder: Path, changes: Iterator[tuple[str, Any]]) -> list[str]:
    """Changes of `dataset.json` that verification does not notice."""
    tried = [(name, bool(faults_with(folder, contents))) for name, contents in changes]
    assert len(tried) > 15
    return [name for name, noticed in tried if not noticed]


def altered(folder: Path, change: Callable[[Any, Any], Any]) -> Iterator[tuple[str, Any]]:
    """The contents of a `dataset.json` with a change at each place, one after the other."""
    whole = json.loads((folder / "dataset.json").read_text())
    for place, part in containers(whole):
        for key in part if isinstance(part, dict) else range(len(part)):
            contents = copy.deepcopy(whole)
            change(at(contents, place), key)
            yield f"{place} {key}", contents


def test_every_writer_states_its_kind_and_is_whole(written, capsys):
    assert read_contents(written).source == written.parent.name.rstrip("0123456789")
    assert verify(written) == ([], len(list(written.glob("*.mcap"))))
    assert main(["--verify", "--out", str(written)]) == 0
    assert "episodes are whole" in capsys.readouterr().out


def test_every_writer_states_the_same_facts_of_the_whole_and_of_each_file(written):
    contents = json.loads((written / "dataset.json").read_text())
    common = set.intersection(*(set(kind.model_fields) for kind in KINDS.values()))
    assert common == {
        *("source", "endotwin", "episodes", "seconds", "bytes", "features", "statistics", "files")
    }
    assert common <= set(contents)
    for file in contents["files"]:
        assert {"name", "samples", "seconds", "bytes", "sha256", "statistics"} <= set(file)


def test_any_key_or_item_removed_is_noticed(folder):
    assert unnoticed(folder, altered(folder, lambda part, key: part.pop(key))) == []


def test_any_value_of_another_type_is_noticed(folder):
    def change(part: Any, key: Any) -> None:
        part[key] = 3.5 if isinstance(part[key], (str, dict, list, type(None))) else "three"

    assert unnoticed(folder, altered(folder, change)) == []


def test_any_key_added_is_noticed(folder):
    whole = json.loads((folder / "dataset.json").read_text())

    def with_key_more() -> Iterator[tuple[str, Any]]:
        for place, part in containers(whole):
            if isinstance(part, dict):
                contents = copy.deepcopy(whole)
                at(contents, place)["colour"] = 1
                yield str(place), contents

    assert unnoticed(folder, with_key_more()) == []


def test_command_says_in_a_line_what_is_missing(folder, capsys):
    whole = json.loads((folder / "dataset.json").read_text())
    places: list[tuple[tuple[Any, ...], int]] = [
        (("source",), 2),
        (("files",), 2),
        (("files", 0, "sha256"), 2),
        (("statistics", "truth_deg", "mean"), 2),
        (("files", 0, "statistics", "truth_deg"), 1),
        (("features", "truth_deg"), 1),
    ]
    if "recipe" in whole:
        places += [(("recipe", "preset", "pretension"), 1), (("recipe", "ranges", "pretension"), 1)]
    for place, code in places:
        contents = copy.deepcopy(whole)
        at(contents, place[:-1]).pop(place[-1])
        (folder / "dataset.json").write_text(json.dumps(contents))
        assert main(["--verify", "--out", str(folder)]) == code, place
        out, err = capsys.readouterr()
        assert "are whole" not in out
        assert "Traceback" not in err
        lines = [line for line in err.replace("\r", "\n").splitlines() if str(folder) in line]
        assert lines
        if code == 2:
            assert len(lines) == 1
            assert "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place)[1:] in lines[0]


def test_record_of_another_preset_or_outside_the_ranges_is_found(tmp_path):
    benchmark(tmp_path)
    whole = json.loads((tmp_path / "dataset.json").read_text())
    nominal, randomized = "record_000.mcap", "record_002.mcap"

    def lines(change: Callable[[dict[str, Any]], Any]) -> list[str]:
        contents = copy.deepcopy(whole)
        change(contents["recipe"])
        return [line.removeprefix(f"{tmp_path}/") for line in faults_with(tmp_path, contents)]

    stiffer = lines(lambda recipe: recipe["preset"].update(wire_stiffness=9e3))
    assert f"{nominal}: wire_stiffness is 8000.0, dataset.json states 9000.0" in stiffer
    (outside,) = lines(lambda recipe: recipe["ranges"].update(pretension=[6.5, 7.0]))
    assert outside.startswith(f"{randomized}: pretension is ")
    assert outside.endswith("drawn from [6.5, 7] by dataset.json")
    assert len(lines(lambda recipe: recipe.update(seed=2))) == 3
    assert len(lines(lambda recipe: recipe.update(seconds=0.2))) == 3
    assert len(lines(lambda recipe: recipe.update(sample_time_s=0.04))) == 3


def test_recipe_with_a_camera_and_a_given_command_fits_the_schema(tmp_path):
    given = (0.0, 1e-3)
    recipe = changed(
        camera=Camera(10, 320, 240), given_pull_m=given, given_lateral_pull_m=given, physics="reduced"
    )
    described = describe(recipe)
    assert {"camera", "given_pull_m", "given_lateral_pull_m", "physics"} <= set(described)
    assert described["given_lateral_pull_m"] == "2 samples: see recipe.yaml"
    assert to_json_values(SimulatedRecipe.model_validate_json(json.dumps(described))) == described
