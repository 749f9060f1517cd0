"""Generating again: only what is missing or damaged is made, and nothing of the user's is overwritten."""

import dataclasses
import errno
import json
import shutil
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import yaml
from small_dataset import NAMES, RECIPE, SECOND, SMALL, changed, contents, identities, make, measured_log

from twin.dataset import episodes as simulated_episode
from twin.dataset import write as dataset
from twin.dataset.episodes import make_episode
from twin.dataset.files import make_files
from twin.dataset.recipe import EpisodeKey, Recipe, to_yaml
from twin.dataset.write import Written, write_dataset
from twin.files.atomic import claim
from twin.measured.folder import write_measured
from twin.preset.randomization import Ranges
from twin.recording import read_episode, write_episode

OWN = "the user's own"


class NoWork:
    """An executor without work."""

    def submit(self, *_: object) -> None:
        raise AssertionError("something is simulated")


def remade(folder: Path, whole: Path, *names: str) -> Written:
    """Make it again: exactly these recordings are new, and the folder is whole."""
    before = identities(folder)
    written = make(folder, csv=True)
    after = identities(folder)
    assert {name for name in after if after[name] != before.get(name)} == {*names}
    assert contents(folder) == contents(whole)
    return written


def test_whole_dataset_is_left_as_it_is_and_nothing_simulated(dataset_copy, whole_dataset, monkeypatch):
    def never(*arguments: Any, **options: Any) -> Any:
        raise AssertionError("simulated")

    monkeypatch.setattr(simulated_episode, "simulate_batch", never)
    written = remade(dataset_copy, whole_dataset)
    assert (written.kept, written.damage) == (3, ())
    assert written.contents == json.loads((whole_dataset / "dataset.json").read_text())


@pytest.mark.parametrize(("names", "known"), [((SECOND,), True), ((NAMES[0], NAMES[2]), False)])
def test_only_what_is_missing_is_made(dataset_copy, whole_dataset, names, known):
    for name in names:
        (dataset_copy / name).unlink()
    if not known:
        (dataset_copy / "dataset.json").unlink()
    written = remade(dataset_copy, whole_dataset, *names)
    assert (written.kept, written.damage) == (3 - len(names), ())


def flip_bit(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def change_bend(path: Path) -> None:
    episode = read_episode(path)
    write_episode(path, dataclasses.replace(episode, bend=episode.bend + 0.1))


def change_version(path: Path) -> None:
    episode = read_episode(path)
    write_episode(path, dataclasses.replace(episode, metadata=episode.metadata | {"mujoco": "2.0.1"}))


@pytest.mark.parametrize(
    ("damage", "what", "known"),
    [
        (flip_bit, "is damaged", True),
        (flip_bit, "is damaged", False),
        (lambda path: path.write_bytes(path.read_bytes()[:9000]), "is cut off", False),
        (lambda path: path.write_bytes(b""), "is cut off: it is empty", True),
        (lambda path: path.write_bytes(b"not at all"), "MCAP", False),
        (lambda path: shutil.copy(path.with_name(NAMES[0]), path), ": episode is 0, not 1", True),
        (
            lambda path: write_episode(
                path, make_episode(changed(sensor_variance_deg2=0.2), EpisodeKey(11, 1))
            ),
            ": recipe_sha256 is ",
            False,
        ),
        (change_bend, " is not as dataset.json states", True),
        (change_bend, ": max of truth_deg is", False),
        (
            lambda path: write_episode(path, read_episode(path).resampled(0.04)),
            " has 25 samples, its metadata states 50",
            False,
        ),
        (change_version, ": mujoco is 2.0.1, not ", False),
    ],
)
def test_damaged_or_other_file_is_made_again_and_named(dataset_copy, whole_dataset, damage, what, known):
    damage(dataset_copy / SECOND)
    if not known:
        (dataset_copy / "dataset.json").unlink()
    written = remade(dataset_copy, whole_dataset, SECOND)
    (line,) = written.damage
    assert written.kept == 2
    assert str(dataset_copy / SECOND) in line
    assert what in line
    assert "\n" not in line


def test_missing_or_changed_table_is_made_again_from_the_recording(dataset_copy, whole_dataset):
    (dataset_copy / "episode_0000.csv").unlink()
    flip_bit(dataset_copy / "episode_0002.csv")
    assert remade(dataset_copy, whole_dataset).damage == (
        f"{dataset_copy / 'episode_0000.csv'} is missing",
        f"{dataset_copy / 'episode_0002.csv'} is not as dataset.json states",
    )


@pytest.mark.parametrize(
    ("few", "more"),
    [
        ({"episodes": 1}, {"episodes": 3}),
        ({"episodes": 1, "seeds": (1, 2)}, {"episodes": 1, "seeds": (1, 2, 3)}),
    ],
)
def test_more_episodes_and_seeds_are_added_to_those_that_are_there(tmp_path, few, more):
    kept = make(tmp_path / "grown", changed(**few)).contents["episodes"]
    before = identities(tmp_path / "grown")
    assert make(tmp_path / "grown", changed(**more), csv=True).kept == kept
    after = identities(tmp_path / "grown")
    assert {name: after[name] for name in before} == before
    make(tmp_path / "at_once", changed(**more), csv=True)
    assert contents(tmp_path / "grown") == contents(tmp_path / "at_once")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"strokes_mm": ((-1.0, 1.5),)}, r"of another recipe \(other strokes_mm\): choose another"),
        ({"seconds": 2.0, "sensor_variance_deg2": 0.2}, r"of another recipe \(other seconds, sensor\)"),
        ({"preset": SMALL.replace(pretension=3.1)}, r"of another recipe \(other preset\)"),
        ({"ranges": Ranges((("pretension", 1.0, 6.0),))}, r"of another recipe \(other ranges\)"),
        ({"seeds": (12,)}, r"holds a dataset of another recipe \(other seeds\)"),
        ({"episodes": 2}, r"holds episode_0002\.mcap, which is not among the 2 episodes"),
    ],
)
def test_another_recipe_is_refused_before_anything_is_touched(dataset_copy, whole_dataset, change, message):
    for _ in range(2):  # by recipe.yaml, and by dataset.json alone
        before = contents(dataset_copy)
        with pytest.raises(ValueError, match=rf"^[^\n]*{message}[^\n]*$"):
            write_dataset(changed(**change), dataset_copy, NoWork(), csv=True)
        assert contents(dataset_copy) == before
        (dataset_copy / "recipe.yaml").unlink(missing_ok=True)
    remade(dataset_copy, whole_dataset)


def test_what_another_version_or_command_made_or_is_damaged_is_refused(dataset_copy, tmp_path):
    path = dataset_copy / "dataset.json"
    text = path.read_text()
    for other, message in (
        (text.replace('"mujoco": "', '"mujoco": "2.'), r"holds a dataset of mujoco 2\..*: choose another"),
        ("{", r"dataset\.json is damaged .*not JSON.*; remove it, and generate the dataset again"),
    ):
        path.write_text(other)
        with pytest.raises(ValueError, match=message):
            write_dataset(RECIPE, dataset_copy, NoWork(), csv=True)
    path.unlink()
    (dataset_copy / "recipe.yaml").unlink()
    with pytest.raises(ValueError, match=r"holds a dataset without a recipe\.yaml: choose another"):
        write_dataset(RECIPE, dataset_copy, NoWork(), csv=True)
    (tmp_path / "log").mkdir()
    write_measured(tmp_path / "log", "log", measured_log(tmp_path))
    with pytest.raises(ValueError, match=r"`generate` did not make \(source measured\): choose another"):
        write_dataset(RECIPE, tmp_path / "log", NoWork())


@pytest.mark.parametrize("name", ["README.md", "loops.png", "episode_0000.csv", "episode_0001.mcap"])
@pytest.mark.parametrize("own_recipe", [False, True])
def test_a_file_of_our_names_that_we_did_not_make_is_refused_before_any_work(tmp_path, name, own_recipe):
    (tmp_path / name).write_text(OWN)
    if own_recipe:
        (tmp_path / "recipe.yaml").write_text("# mine\n" + to_yaml(RECIPE))
    before = contents(tmp_path)
    with pytest.raises(ValueError, match=rf"^[^\n]*({name}|holds a dataset without a recipe)"):
        write_dataset(RECIPE, tmp_path, NoWork(), csv=True)
    assert contents(tmp_path) == before
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match=f"{name} is a link|without a recipe"):
        write_dataset(RECIPE, tmp_path, NoWork(), csv=True)


def test_what_the_user_wrote_into_the_folder_stays(dataset_copy):
    own = "# mine\n" + yaml.safe_dump(yaml.safe_load(to_yaml(RECIPE)))
    hidden = ".episode_0001.mcap.0123abcd.partial"
    for name, text in (("recipe.yaml", own), ("README.md", OWN), (hidden, OWN)):
        (dataset_copy / name).write_text(text)
    before = contents(dataset_copy)
    make(dataset_copy, csv=True)
    assert contents(dataset_copy) == before
    for other in (changed(seconds=0.5), changed(episodes=4)):
        with pytest.raises(ValueError, match=r"recipe\.yaml is not what `generate` wrote, nor this recipe"):
            make(dataset_copy, other)
    (dataset_copy / "recipe.yaml").write_text(to_yaml(RECIPE))
    make(dataset_copy, changed(episodes=4))
    assert (dataset_copy / "README.md").read_text() == OWN


def test_a_table_that_is_not_of_the_episode_is_not_overwritten(tmp_path):
    make(tmp_path, RECIPE)
    (tmp_path / "episode_0001.csv").write_text(OWN)
    with pytest.raises(ValueError, match=r"episode_0001\.csv is there, and `generate` did not make it"):
        make(tmp_path, RECIPE, csv=True)
    assert (tmp_path / "episode_0001.csv").read_text() == OWN


def test_late_task_of_a_run_that_is_over_and_worker_of_another_version_write_nothing(dataset_copy):
    whole = contents(dataset_copy)
    other = changed(seconds=0.5)
    with pytest.raises(ValueError, match="is the folder of another dataset by now"):
        make_files(other, other.keys[:1], dataset_copy, {}, False)
    with pytest.raises(ValueError, match=r"a worker has endotwin .*, here is endotwin 9: they must agree"):
        make_files(RECIPE, RECIPE.keys, dataset_copy, {}, False, {"endotwin": "9"})
    assert contents(dataset_copy) == whole


def interrupted(recipe: Recipe, folder: Path, at: int) -> None:
    def stop(done: int, total: int) -> None:
        if done == at:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as executor:
        write_dataset(recipe, folder, executor, csv=True, on_progress=stop)


def test_interrupted_extension_leaves_the_dataset_and_the_next_completes_it(dataset_copy, whole_dataset):
    interrupted(changed(episodes=4), dataset_copy, at=0)
    assert (dataset_copy / "dataset.json").read_bytes() == (whole_dataset / "dataset.json").read_bytes()
    interrupted(changed(episodes=4), dataset_copy, at=4)
    make(dataset_copy, changed(episodes=4), csv=True)
    make(dataset_copy.parent / "at_once", changed(episodes=4), csv=True)
    assert contents(dataset_copy) == contents(dataset_copy.parent / "at_once")


def test_a_figure_that_cannot_be_drawn_stops_no_episode(tmp_path, monkeypatch, whole_dataset):
    def fail(folder: Path, recipe: Recipe) -> None:
        raise ValueError("no font")

    with monkeypatch.context() as patched:
        patched.setattr(dataset, "write_figure", fail)
        with pytest.raises(ValueError, match="no font"):
            make(tmp_path, csv=True)
    assert len(list(tmp_path.glob("*.mcap"))) == 3
    remade(tmp_path, whole_dataset)


class Failing(Executor):
    """Its second task fails."""

    def __init__(self, failure: Exception) -> None:
        self.failure, self.tasks = failure, 0

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.tasks += 1
        if self.tasks == 1:
            future.set_result(function(*args, **kwargs))
        else:
            future.set_exception(self.failure)
        return future


@pytest.mark.parametrize(
    "failure",
    [OSError(errno.ENOSPC, "No space left on device", "somewhere/file"), BrokenExecutor("terminated")],
)
def test_failure_names_what_is_whole_and_the_same_call_goes_on(whole_dataset, tmp_path, failure):
    line = "(No space left|a worker was killed).*: 1 of 3 episodes are complete; the same command continues"
    with pytest.raises(type(failure), match=line):
        write_dataset(RECIPE, tmp_path, Failing(failure), workers=3, csv=True)
    assert not (tmp_path / "dataset.json").exists()
    assert remade(tmp_path, whole_dataset, *NAMES[1:]).kept == 1


def test_a_run_claims_its_folder_from_beginning_to_end(tmp_path, dataset_copy, whole_dataset):
    refused = []

    def try_to(done: int, total: int) -> None:
        with pytest.raises(ValueError, match="another run is writing into"):
            make(tmp_path / "made")
        refused.append(done)

    with ThreadPoolExecutor(1) as executor:
        write_dataset(RECIPE, tmp_path / "made", executor, on_progress=try_to)
    assert refused == [0, 3]
    with claim(dataset_copy), pytest.raises(ValueError, match=r"another run is writing into .*data: wait"):
        make(dataset_copy, csv=True)
    assert contents(dataset_copy) == contents(whole_dataset)
