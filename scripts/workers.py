"""Where the work of a dataset is done: processes of this machine, or a Dask cluster of many."""

import contextlib
import logging
import multiprocessing
import os
import re
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, ProcessPoolExecutor

CONNECT_SECONDS = 20
"""How long a Dask scheduler may take to answer."""


@contextlib.contextmanager
def local_workers(count: int) -> Iterator[Executor]:
    """Context manager: an executor of processes, which end with this one however it ends.

    Args:
        count: how many processes.
    """
    # Fresh processes: a fork would copy whatever threads and libraries this one has loaded.
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, fresh, initializer=_begin_worker) as executor:
        try:
            yield executor
        except BaseException:
            for process in multiprocessing.active_children():  # nobody wants what is half done
                process.terminate()
            executor.shutdown(cancel_futures=True)
            raise


@contextlib.contextmanager
def dask_workers(address: str) -> Iterator[tuple[Executor, int]]:
    """Context manager: an executor of the workers of a Dask cluster, and how many tasks they run at a time.

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
        raise ValueError("--dask needs Dask: pip install 'endotwin[cluster]'") from error
    if not re.fullmatch(r"[a-z]+://[^\s/]+:\d+", address):
        raise ValueError(f"--dask {address}: must be as in tcp://192.168.0.7:8786")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters of it is said here
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise ValueError(f"--dask {address}: no Dask scheduler answers there") from error
    with client:
        threads = sum(client.nthreads().values())
        if threads == 0:
            start = f"start some with `dask worker {address} --nthreads 1`"
            raise ValueError(f"--dask {address}: the scheduler has no workers: {start}")
        try:
            yield client.get_executor(pure=False), threads
        except (KilledWorker, CancelledError) as error:
            lost = "the Dask cluster lost its workers or the task"
            raise BrokenExecutor(
                f"{lost}; what is whole stays, the same command goes on from there"
            ) from error


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, and end when it is gone: an orphan would wait for work for ever."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
