"""Worker processes: they make the bytes of one, and end with the block that started them."""

import os

import pytest
from small_dataset import contents
from workers_recipe import RECIPE

from twin.dataset.write import write_dataset
from twin.workers.processes import choose_workers


def test_two_processes_make_the_bytes_of_one_and_end_with_the_block_that_started_them(local, tmp_path):
    with choose_workers(len(RECIPE.keys), 2) as (executor, workers):
        assert workers == 2
        write_dataset(RECIPE, tmp_path / "two", executor, workers=workers)
        pids = {executor.submit(os.getpid).result() for _ in range(8)}
    assert contents(tmp_path / "two") == contents(local)
    assert os.getpid() not in pids
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_no_more_processes_than_tasks_are_started():
    for tasks, processes, count in ((1, 4, 1), (1, 0, 1), (3, 1, 1)):
        with choose_workers(tasks, processes) as (_, workers):
            assert workers == count
    with pytest.raises(ValueError, match=r"^workers = -1: must be from 0 to 1024$"), choose_workers(1, -1):
        pass
