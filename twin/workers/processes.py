"""Worker processes of this machine, which end with their parent process, or the workers of a Dask cluster."""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, MutableMapping
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.managers import SyncManager
from typing import Any

from twin.files.bounds import MOST_WORKERS, check_between


@contextlib.contextmanager
def choose_workers(
    tasks: int, processes: int = 0, dask: str | None = None, begin: Callable[[], object] | None = None
) -> Iterator[tuple[Executor, int]]:
    """Context manager: an executor, and how many tasks it runs at a time."""
    check_between("workers", processes, 0, MOST_WORKERS)
    if dask is not None:
        from twin.workers.dask_cluster import dask_workers

        with dask_workers(dask, begin) as workers:
            yield workers
        return
    count = min(processes or os.cpu_count() or 1, tasks)
    with local_workers(count, begin) as executor:
        yield executor, count


@contextlib.contextmanager
def local_workers(count: int, begin: Callable[[], object] | None = None) -> Iterator[Executor]:
    """Context manager: an executor of worker processes, which end with this process however it ends.

    Each calls `begin` first, which must be picklable.
    """
    with ProcessPoolExecutor(
        count, _FreshContext(), initializer=_begin_worker, initargs=(begin,)
    ) as executor:
        try:
            yield executor
        except BaseException:
            for process in multiprocessing.active_children():  # unfinished work is of no use
                process.terminate()
            executor.shutdown(cancel_futures=True)
            raise


@contextlib.contextmanager
def shared_table() -> Iterator[MutableMapping[Any, Any]]:
    """Context manager: a table that processes of this machine read and write, in a process of its own."""
    manager = SyncManager(ctx=_FreshContext())
    manager.start(initializer=_begin_worker)
    with manager:
        yield manager.dict()


class _QuietProcess(SpawnProcess):
    """A fresh process that ignores Ctrl-C while it starts: it would print a traceback."""

    def start(self) -> None:
        """Start it with the signal held back."""
        if not hasattr(signal, "pthread_sigmask"):  # Windows
            super().start()
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _FreshContext(SpawnContext):
    """Fresh processes: a fork would copy whatever threads and libraries this one has loaded."""

    Process = _QuietProcess


def _begin_worker(begin: Callable[[], object] | None = None) -> None:
    """Initialise a worker: ignore Ctrl-C and end with the parent, as an orphan would wait for ever."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    if begin is not None:
        begin()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
