"""Advisory lock on a folder: one run at a time writes into it."""

import contextlib
import errno
import os
import time
from collections.abc import Iterator
from pathlib import Path

from twin.errors import InputError

_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.EBADF, errno.EINVAL, errno.EACCES)
"""Error numbers of file systems that cannot lock a folder."""

_PAUSE = 0.05
"""Time between two attempts [s]."""


@contextlib.contextmanager
def claim(folder: Path, wait_seconds: float = 0.0) -> Iterator[None]:
    """Context manager: an exclusive advisory lock on a folder, released when the process ends.

    Some file systems cannot lock folders (NFS). There, nothing keeps two runs apart: each file is whole all
    the same, but one run may find that the other has removed what it was writing, and end with an error.

    Args:
        folder: which; a link to a folder is that folder.
        wait_seconds: how long to wait for another process [s].

    Raises:
        FileNotFoundError: there is no such folder, or it was removed meanwhile.
        ValueError: another process is still writing into it.
    """
    try:
        import fcntl  # noqa: F401
    except ImportError:  # Windows has none: there, nothing keeps two runs apart
        yield
        return
    descriptor = _claimed(folder, time.monotonic() + wait_seconds)
    try:
        yield
    finally:
        os.close(descriptor)


def _claimed(folder: Path, until: float) -> int:
    """Return the descriptor of a folder that is locked, at the latest at some time of the monotonic clock."""
    while True:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            # Another folder may have taken the name while this one was waited for.
            if lock_file(descriptor) and os.path.samestat(os.fstat(descriptor), os.stat(folder)):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)
        if time.monotonic() >= until:
            raise InputError(f"another run is writing into {folder}: wait for it, or stop it")
        time.sleep(_PAUSE)


def lock_file(descriptor: int) -> bool:
    """Lock an open file or folder until it is closed; returns False if another process holds it.

    Where the system or the file system has no such locks, nothing is locked and the answer is True.
    """
    try:
        import fcntl
    except ImportError:  # Windows has none
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
    return True
