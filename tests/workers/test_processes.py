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
