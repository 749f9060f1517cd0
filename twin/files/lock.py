"""Advisory lock on a folder: one run at a time writes into it."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from twin.errors import InputError

_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.EBADF, errno.EINVAL, errno.EACCES)
"""Error numbers of file systems that cannot lock a folder."""


@contextlib.contextmanager
def claim(folder: Path) -> Iterator[None]:
    """Context manager: an exclusive advisory lock on a folder, released when the process ends.

    Some file systems cannot lock folders (NFS). There, nothing keeps two runs apart: each file is whole all
    the same, but one run may find that the other has removed what it was writing, and end with an error.

    Raises:
        ValueError: another process is writing into it.
    """
    try:
        import fcntl
    except ImportError:  # Windows has none: there, nothing keeps two runs apart
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"another run is writing into {folder}: wait for it, or stop it") from error
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
        yield
    finally:
        os.close(descriptor)
