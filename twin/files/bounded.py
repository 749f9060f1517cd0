"""Bytes of a regular file, up to a limit, for all readers; and its SHA-256."""

import contextlib
import errno
import hashlib
import os
import stat
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path

from twin.errors import InputError, MissingFileError
from twin.files.shown import named

MEBIBYTE = 2**20  # [bytes]

_NOT_THERE = (errno.ENOENT, errno.ENOTDIR)
_UNREADABLE = (errno.EACCES, errno.EPERM, errno.ELOOP, errno.ENAMETOOLONG, errno.ENXIO, errno.ENODEV)


def read_limited(path: str | Path, most_bytes: int) -> bytes:
    """Read a regular file of at most so many bytes; a link is followed.

    A named pipe would block for ever and a device never end: neither is read. Of a file that grows while it
    is read, at most one byte more is read.
    """
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size <= most_bytes:
            content = file.read(most_bytes + 1)
            size = len(content)
    if size > most_bytes:
        raise InputError(f"{named(path)} has {size} bytes or more: at most {most_bytes} are read")
    return content


@contextlib.contextmanager
def opened(path: str | Path, wanted: str = "a file") -> Iterator[BufferedReader]:
    """Context manager: a regular file, open for reading; an `OSError` of a read names it."""
    try:
        with open(open_regular(path, wanted), "rb") as file:
            yield file
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror, named(path)) from error


def open_regular(path: str | Path, wanted: str = "a file") -> int:
    """Open a regular file for reading; returns its descriptor, which the caller closes.

    Messages name what is `wanted`.
    """
    # Without O_NONBLOCK, opening a pipe waits for a writer.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
    try:
        descriptor = os.open(path, flags | getattr(os, "O_BINARY", 0))
    except OSError as error:
        if error.errno in _NOT_THERE:
            raise MissingFileError(f"no file {named(path)}") from error
        if error.errno in _UNREADABLE:
            raise InputError(f"{named(path)} cannot be read: {error.strerror}") from error
        raise
    except ValueError as error:  # a name that no file can have
        raise InputError(f"{str(path)!r:.60} is no name of a file: {error}") from error
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        what = f"a folder, not {wanted}" if stat.S_ISDIR(mode) else "no regular file"
        raise InputError(f"{named(path)} is {what}")
    return descriptor


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
