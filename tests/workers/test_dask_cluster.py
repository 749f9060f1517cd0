"""A Dask cluster makes the same dataset, though one of its workers is killed."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor

import pytest
from distributed import KilledWorker, LocalCluster
from small_dataset import contents
from workers_recipe import RECIPE

from twin.dataset.write import write_dataset
from twin.workers.dask_cluster import dask_workers


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


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
