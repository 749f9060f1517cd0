"""Workers of a Dask cluster, on as many machines as it has."""

import contextlib
import logging
import re
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor

from twin.errors import InputError

CONNECT_SECONDS = 20
"""Timeout of the connection to a Dask scheduler [s]."""


@contextlib.contextmanager
def dask_workers(address: str) -> Iterator[tuple[Executor, int]]:
    """Context manager: an executor on a Dask cluster, and the number of tasks that it runs at a time.

    A task whose worker dies is given to another one.

    Args:
        address: of the scheduler, such as `tcp://192.168.0.7:8786`.

    Raises:
        ValueError: Dask is not installed, no scheduler answers, or it has no workers.
        BrokenExecutor: the cluster gave up a task, whose workers died again and again.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise InputError("a Dask cluster needs Dask: pip install 'endotwin[cluster]'") from error
    if not re.fullmatch(r"[a-z]+://[^\s/]+:\d+", address):
        raise InputError(f"address = {address}: must be as in tcp://192.168.0.7:8786")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters of it is said here
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"address = {address}: no Dask scheduler answers there") from error
    with client:
        threads = sum(client.nthreads().values())
        if threads == 0:
            start = f"start some with `dask worker {address} --nthreads 1`"
            raise InputError(f"address = {address}: the scheduler has no workers: {start}")
        try:
            yield client.get_executor(pure=False), threads
        except (KilledWorker, CancelledError) as error:
            lost = "the Dask cluster lost its workers or the task"
            raise BrokenExecutor(
                f"{lost}; what is whole stays, the same command goes on from there"
            ) from error
