"""A run that breaks off: what is whole stays, the same call goes on, and none writes beside another."""

import errno
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from small_dataset import NAMES, RECIPE, changed, contents, make

from twin.dataset import write as dataset
from twin.dataset.recipe import EpisodeKey, Recipe
from twin.dataset.write import write_dataset
from twin.files.atomic import claim


def stop(done: int, total: int) -> None:
    raise KeyboardInterrupt


def test_run_that_is_interrupted_keeps_the_hashes_of_the_former_one(dataset_copy, whole_dataset):
    (dataset_copy / NAMES[0]).unlink()
    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as executor:
        write_dataset(RECIPE, dataset_copy, executor, csv=True, on_progress=stop)
    table = dataset_copy / "episode_0001.csv"
    table.write_text(table.read_text().replace("0.02,", "0.03,"))
    written = make(dataset_copy, csv=True)
    assert written.damage == (f"{table} is not as dataset.json states",)
    assert contents(dataset_copy) == contents(whole_dataset)


def test_extension_that_is_interrupted_leaves_the_dataset_as_it_was(dataset_copy, whole_dataset):
    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as executor:
        write_dataset(changed(episodes=5), dataset_copy, executor, csv=True, on_progress=stop)
    assert (dataset_copy / "dataset.json").read_bytes() == (whole_dataset / "dataset.json").read_bytes()


def test_the_card_of_an_extension_that_was_interrupted_is_written_by_the_next(tmp_path):
    """Its recipe.yaml tells of more episodes than the card of the former run."""

    def stop_at_the_end(done: int, total: int) -> None:
        if done == total:
            raise KeyboardInterrupt

    make(tmp_path / "grown", changed(episodes=2))
    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as executor:
        write_dataset(changed(episodes=4), tmp_path / "grown", executor, on_progress=stop_at_the_end)
    make(tmp_path / "grown", changed(episodes=4))
    make(tmp_path / "at_once", changed(episodes=4))
    assert contents(tmp_path / "grown") == contents(tmp_path / "at_once")


def test_a_figure_that_cannot_be_drawn_stops_no_episode(tmp_path, monkeypatch):
    def fail(folder: Path, recipe: Recipe) -> None:
        raise ValueError("no font")

    recipe = changed(episodes=20, seconds=0.2)
    with monkeypatch.context() as patched:
        patched.setattr(dataset, "write_figure", fail)
        with pytest.raises(ValueError, match="no font"):
            make(tmp_path / "twice", recipe)
    assert len(list((tmp_path / "twice").glob("*.mcap"))) == 20
    make(tmp_path / "twice", recipe)
    make(tmp_path / "once", recipe)
    assert contents(tmp_path / "twice") == contents(tmp_path / "once")


def test_hidden_files_of_the_user_stay(dataset_copy, whole_dataset):
    names = {".episode_0001.mcap.0123abcd.partial", ".README.md.ffffffff.partial"}
    for name in names:
        (dataset_copy / name).write_bytes(b"theirs")
    make(dataset_copy, csv=True)
    assert contents(dataset_copy) == contents(whole_dataset) | dict.fromkeys(names, b"theirs")


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
