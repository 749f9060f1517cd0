"""Pool of worker processes on this machine, which end with their parent process."""

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


@contextlib.contextmanager
def local_workers(count: int, begin: Callable[[], object] | None = None) -> Iterator[Executor]:
    """Context manager: an executor of worker processes, which end with this process however it ends.

    Args:
        count: number of processes.
        begin: what each does first; picklable.
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
    """Context manager: a table that processes of this machine read and write, in one that ends with it."""
    manager = SyncManager(ctx=_FreshContext())
    manager.start(initializer=_begin_worker)
    with manager:
        yield manager.dict()


class _DeafProcess(SpawnProcess):
    """A fresh process that hears no Ctrl-C while it starts: it would show where it was."""

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

    Process = _DeafProcess


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
