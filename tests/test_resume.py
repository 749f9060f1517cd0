"""Generating again: only what is missing or damaged is made, the rest is not touched, no two runs collide."""

import dataclasses
import errno
import json
import shutil
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import pytest
from small_dataset import RECIPE, SMALL, changed, contents, identities, make

from twin import dataset, simulated_episode
from twin.dataset import write_dataset
from twin.randomization import Ranges
from twin.recipe import EpisodeKey, Recipe
from twin.recording import read_episode, write_episode
from twin.recording.atomic import claim
from twin.simulated_episode import make_episode

NAMES = [f"episode_000{number}.mcap" for number in range(3)]
SECOND = NAMES[1]


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


def test_run_that_is_interrupted_keeps_the_hashes_of_the_former_one(dataset_copy, whole_dataset):
    (dataset_copy / NAMES[0]).unlink()
    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as executor:
        write_dataset(RECIPE, dataset_copy, executor, csv=True, on_progress=stop)
    table = dataset_copy / "episode_0001.csv"
    table.write_text(table.read_text().replace("0.02,", "0.03,"))
    written = make(dataset_copy, csv=True)
    assert written.damage == (f"{table} is not what dataset.json says",)
    assert contents(dataset_copy) == contents(whole_dataset)


def stop(done: int, total: int) -> None:
    raise KeyboardInterrupt


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
    assert written.damage == (f"{dataset_copy / SECOND} is not what dataset.json says",)


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
        f"{table} is not what dataset.json says",
    )


def test_tables_are_added_to_a_dataset_without(whole_dataset, tmp_path):
    make(tmp_path)
    (tmp_path / "episode_0001.csv").write_text("somebody's")
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


@pytest.mark.parametrize(
    ("change", "other"),
    [
        ({"strokes_mm": ((-1.0, 1.5),)}, "strokes_mm"),
        ({"seconds": 2.0, "sensor_variance_deg2": 0.2}, "seconds, sensor"),
        ({"preset": SMALL.replace(pretension=3.1)}, "preset"),
        ({"ranges": Ranges((("pretension", 1.0, 6.0),))}, "ranges"),
        ({"sheath_bends_deg": ((0.0, 90.0),)}, "sheath_bends_deg"),
    ],
)
def test_another_recipe_is_refused_before_anything_is_touched(dataset_copy, whole_dataset, change, other):
    before = identities(dataset_copy)
    with pytest.raises(
        ValueError, match=rf"holds a dataset of another recipe \(other {other}\): "
    ) as refused:
        make(dataset_copy, changed(**change), csv=True)
    assert "choose another --out or remove it" in str(refused.value)
    assert "\n" not in str(refused.value)
    assert identities(dataset_copy) == before
    assert contents(dataset_copy) == contents(whole_dataset)


def test_what_a_killed_run_left_half_written_is_removed(dataset_copy, whole_dataset):
    for name in (".episode_0001.mcap.0123abcd.partial", ".README.md.ffffffff.partial"):
        (dataset_copy / name).write_bytes(b"half")
    make(dataset_copy, csv=True)
    assert contents(dataset_copy) == contents(whole_dataset)


def test_second_run_into_the_same_folder_is_refused_in_one_line_and_harms_nothing(
    dataset_copy, whole_dataset
):
    with (
        claim(dataset_copy),
        pytest.raises(ValueError, match=r"another run is writing into .*data: wait") as refused,
    ):
        make(dataset_copy, csv=True)
    assert "\n" not in str(refused.value)
    assert contents(dataset_copy) == contents(whole_dataset)
    make(dataset_copy, csv=True)  # the claim has ended


def test_run_claims_its_folder_from_beginning_to_end(tmp_path):
    refused = []

    def try_to(done: int, total: int) -> None:
        with pytest.raises(ValueError, match="another run is writing into"):
            make(tmp_path)
        refused.append(done)

    with ThreadPoolExecutor(1) as executor:
        write_dataset(RECIPE, tmp_path, executor, on_progress=try_to)
    assert refused == [0, 3]


def test_extension_that_is_interrupted_leaves_the_dataset_as_it_was(dataset_copy, whole_dataset):
    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as executor:
        write_dataset(changed(episodes=5), dataset_copy, executor, csv=True, on_progress=stop)
    assert (dataset_copy / "dataset.json").read_bytes() == (whole_dataset / "dataset.json").read_bytes()


def test_failure_says_what_is_whole_and_the_same_call_goes_on(whole_dataset, tmp_path, monkeypatch):
    def full_at_second(recipe: Recipe, keys: list[EpisodeKey], *rest: Any) -> Any:
        if keys[0].number == 1:
            raise OSError(errno.ENOSPC, "No space left on device", "somewhere/file")
        return make_files(recipe, keys, *rest)

    make_files = dataset.make_files
    monkeypatch.setattr(dataset, "make_files", full_at_second)
    with ThreadPoolExecutor(1) as executor, pytest.raises(OSError, match="No space left") as failed:
        write_dataset(RECIPE, tmp_path, executor, workers=3, csv=True)
    whole_ones = len(list(tmp_path.glob("*.mcap")))
    line = f"{whole_ones} of 3 episodes are whole, the same command goes on from there"
    assert failed.value.strerror == f"No space left on device: {line}"
    assert failed.value.filename == "somewhere/file"
    assert failed.value.errno == errno.ENOSPC
    assert 1 <= whole_ones < 3
    assert not (tmp_path / "dataset.json").exists()
    monkeypatch.undo()
    written = make(tmp_path, csv=True)
    assert written.kept == whole_ones
    assert contents(tmp_path) == contents(whole_dataset)


class Breaking(Executor):
    """Its worker is killed at the second task."""

    def __init__(self) -> None:
        self.tasks = 0

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.tasks += 1
        if self.tasks == 1:
            future.set_result(function(*args, **kwargs))
        else:
            future.set_exception(BrokenExecutor("a process in the pool was terminated abruptly"))
        return future


def test_killed_worker_says_what_is_whole_and_the_same_call_goes_on(whole_dataset, tmp_path):
    line = "a worker was killed, .*: 1 of 3 episodes are whole, the same command goes on from there"
    with pytest.raises(BrokenExecutor, match=line):
        write_dataset(RECIPE, tmp_path, Breaking(), workers=3, csv=True)
    assert not (tmp_path / "dataset.json").exists()
    assert make(tmp_path, csv=True).kept == 1
    assert contents(tmp_path) == contents(whole_dataset)


def test_nothing_is_simulated_where_nothing_is_missing(dataset_copy, monkeypatch):
    def never(*arguments: Any, **options: Any) -> Any:
        raise AssertionError("simulated")

    monkeypatch.setattr(simulated_episode, "simulate_batch", never)
    assert make(dataset_copy, csv=True).kept == 3
    (dataset_copy / SECOND).unlink()
    with pytest.raises(AssertionError, match="simulated"):
        make(dataset_copy, csv=True)
