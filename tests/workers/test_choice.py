"""The workers that are asked for: no more processes than tasks, none of a negative number."""

import os

import pytest

from twin.workers.choice import choose_workers


@pytest.mark.parametrize(("tasks", "processes", "count"), [(3, 1, 1), (1, 4, 1), (1, 0, 1)])
def test_no_more_processes_than_tasks(tasks, processes, count):
    with choose_workers(tasks, processes) as (executor, workers):
        assert workers == count
        assert executor.submit(os.getpid).result() != os.getpid()


def test_a_negative_number_is_refused():
    with pytest.raises(ValueError, match=r"^workers = -1: must not be negative$"), choose_workers(1, -1):
        pass
