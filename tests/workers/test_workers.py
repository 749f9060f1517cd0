"""The same dataset from processes of one machine and from a Dask cluster, one of whose workers is killed."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest
from distributed import KilledWorker, LocalCluster
from small_dataset import SMALL, contents

from twin.dataset.recipe import Recipe
from twin.dataset.write import write_dataset
from twin.workers.dask_cluster import dask_workers
from twin.workers.processes import local_workers

RECIPE = Recipe(SMALL, ((-1.0, 1.0), (0.0, 2.0)), seconds=2.0, episodes=40, seeds=(5,))


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("local") / "data"
    with local_workers(1) as executor:
        write_dataset(RECIPE, folder, executor, workers=1)
    return folder


def test_two_processes_make_the_bytes_of_one(local, tmp_path):
    with local_workers(2) as executor:
        write_dataset(RECIPE, tmp_path / "two", executor, workers=2)
    assert contents(tmp_path / "two") == contents(local)


def test_cluster_makes_the_same_bytes_though_a_worker_is_killed_in_the_middle(cluster, local, tmp_path):
    folder, killed = tmp_path / "cluster", []

    def kill_one() -> None:
        """As soon as there is a first episode, and while others are being made."""
        while not list(folder.glob("*.mcap")):
            time.sleep(0.005)
        pid = next(iter(cluster.workers.values())).pid
        killed.append(len(list(folder.glob("*.mcap"))))
        os.kill(pid, signal.SIGKILL)

    threading.Thread(target=kill_one, daemon=True).start()
    with dask_workers(cluster.scheduler_address) as (executor, workers):
        assert workers == 2
        # Small tasks, so that most of them are still to be done when the worker dies.
        write_dataset(RECIPE, folder, executor, workers=10)
    assert killed
    assert 0 < killed[0] < RECIPE.episodes
    assert contents(folder) == contents(local)


def test_scheduler_that_does_not_answer_is_said_in_one_line(monkeypatch):
    monkeypatch.setattr("twin.workers.dask_cluster.CONNECT_SECONDS", 0.5)
    with (
        pytest.raises(ValueError, match=r"address = tcp://127\.0\.0\.1:9: no Dask scheduler answers there"),
        dask_workers("tcp://127.0.0.1:9"),
    ):
        pass


def test_cluster_that_gives_a_task_up_is_said_with_what_to_do(cluster):
    with (
        pytest.raises(BrokenExecutor, match="lost its workers or the task; what is whole stays, the same"),
        dask_workers(cluster.scheduler_address),
    ):
        raise KilledWorker("make_files", None, 3)


def test_processes_end_with_the_block_that_started_them():
    with local_workers(2) as executor:
        pids = {executor.submit(os.getpid).result() for _ in range(8)}
    assert os.getpid() not in pids
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
