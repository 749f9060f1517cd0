"""Worker processes: they make the bytes of one, and end with the block that started them."""

import os

import pytest
from small_dataset import contents
from workers_recipe import RECIPE

from twin.dataset.write import write_dataset
from twin.workers.processes import local_workers


def test_two_processes_make_the_bytes_of_one(local, tmp_path):
    with local_workers(2) as executor:
        write_dataset(RECIPE, tmp_path / "two", executor, workers=2)
    assert contents(tmp_path / "two") == contents(local)


def test_processes_end_with_the_block_that_started_them():
    with local_workers(2) as executor:
        pids = {executor.submit(os.getpid).result() for _ in range(8)}
    assert os.getpid() not in pids
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
