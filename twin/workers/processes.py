"""Pool of worker processes on this machine, which end with their parent process."""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor


@contextlib.contextmanager
def local_workers(count: int) -> Iterator[Executor]:
    """Context manager: an executor of worker processes, which end with this process however it ends.

    Args:
        count: number of processes.
    """
    # Fresh processes: a fork would copy whatever threads and libraries this one has loaded.
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, fresh, initializer=_begin_worker) as executor:
        try:
            yield executor
        except BaseException:
            for process in multiprocessing.active_children():  # unfinished work is of no use
                process.terminate()
            executor.shutdown(cancel_futures=True)
            raise


def _begin_worker() -> None:
    """Initialise a worker: ignore Ctrl-C and end with the parent, as an orphan would wait for ever."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
