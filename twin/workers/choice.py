"""The workers that a command asks for: processes of this machine, or those of a Dask cluster."""

import contextlib
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor

from twin.errors import InputError
from twin.files.bounds import MOST_WORKERS, check_between


@contextlib.contextmanager
def choose_workers(
    tasks: int,
    processes: int = 0,
    dask: str | None = None,
    begin: Callable[[], object] | None = None,
) -> Iterator[tuple[Executor, int]]:
    """Context manager: an executor, and how many tasks it runs at a time.

    Args:
        tasks: how many there are to do: no more processes are started.
        processes: how many at most; 0 for one per core.
        dask: address of a Dask scheduler, whose workers are taken instead.
        begin: what each worker does first; picklable.

    Raises:
        ValueError: the number of processes is negative, or no Dask scheduler answers at the address.
    """
    if processes < 0:
        raise InputError(f"workers = {processes}: must not be negative")
    check_between("workers", processes, 0, MOST_WORKERS)
    if dask is not None:
        from twin.workers.dask_cluster import dask_workers

        with dask_workers(dask, begin) as workers:
            yield workers
        return
    from twin.workers.processes import local_workers

    count = min(processes or os.cpu_count() or 1, tasks)
    with local_workers(count, begin) as executor:
        yield executor, count
