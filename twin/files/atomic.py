"""Atomic writing: a file appears under its name only when it is complete."""

import contextlib
import errno
import glob
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from twin.errors import InputError, MissingFileError

_NO_NAMELESS_FILES = (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL, errno.ENOENT)
"""Error numbers of systems that make no file without a name: another kernel, NFS."""

_LONGEST_NAME = 200
"""Characters of a name that a temporary name holds: file systems take 255 in all."""


class WholeFile:
    """Context manager: an open binary file that takes its final name when the block succeeds.

    Until then it has no name at all (Linux, `O_TMPFILE`), so that nothing is left of it however the process
    ends. Where the system cannot do that, it is `.NAME.XXXXXXXX.partial` in the same folder, made afresh;
    then a killed process leaves it, and nothing removes it, as nobody could tell it from a user's file.
    Under an exception, what stood under the final name before is left as it was.
    """

    def __init__(self, path: str | Path) -> None:
        """Name the file; nothing is opened yet.

        Args:
            path: the final name.

        While the block runs, `open_path` is a path for libraries that take no open file.
        """
        self.path = Path(path)
        self.open_path = ""
        self._named: Path | None = None  # its temporary name, where it has one

    def __enter__(self) -> BinaryIO:
        """Open the file.

        Raises:
            FileNotFoundError: the folder does not exist.
            ValueError: the name is taken by a link or by something else that is no file.
        """
        if not self.path.parent.is_dir():
            raise MissingFileError(f"no folder {self.path.parent} to write {self.path.name} into")
        refuse_no_file(self.path)
        descriptor = _open_nameless(self.path.parent)
        if descriptor is None:
            self._named = temporary_name(self.path)
            self._file: BinaryIO = self._named.open("xb")
            self.open_path = str(self._named)
        else:
            self._file = os.fdopen(descriptor, "wb")
            self.open_path = f"/proc/self/fd/{descriptor}"
        return self._file

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Give the file its final name, or remove it if the block was left by an exception.

        Raises:
            OSError: the disk is full or fails; the error names the file.
        """
        try:
            if kind is None:
                self._file.flush()
                # The data must be on the disk before the name is, or a power cut leaves an empty file.
                os.fsync(self._file.fileno())
                self._take_name()
        except OSError as failure:
            raise OSError(failure.errno, failure.strerror, str(self.path)) from failure
        finally:
            with contextlib.suppress(OSError):  # closing writes what is left, which a full disk refuses again
                self._file.close()
            if self._named is not None:
                self._named.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno and error.filename in (None, self.open_path):
            raise OSError(error.errno, error.strerror, str(self.path)) from error

    def _take_name(self) -> None:
        if self._named is None:
            with contextlib.suppress(FileExistsError):
                _link(self._file.fileno(), self.path)
                return
            self._named = temporary_name(self.path)
            _link(self._file.fileno(), self._named)
        self._file.close()  # Windows renames no open file
        os.replace(self._named, self.path)


def temporary_name(path: Path) -> Path:
    """Return a hidden name beside a path, `.NAME.XXXXXXXX.partial`, which no file has by chance."""
    return path.with_name(f".{path.name[:_LONGEST_NAME]}.{secrets.token_hex(4)}.partial")


def temporary_names(path: Path) -> Iterator[Path]:
    """Yield all that is there under temporary names of a path, whoever made it."""
    return path.parent.glob(f".{glob.escape(path.name[:_LONGEST_NAME])}.????????.partial")


def write_whole(path: str | Path, content: bytes | str) -> None:
    """Write a file atomically; text as UTF-8.

    Raises:
        FileNotFoundError: the folder does not exist.
        ValueError: the name is taken by a link or by something else that is no file.
        OSError: the disk is full or fails.
    """
    with WholeFile(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def refuse_no_file(path: Path) -> None:
    """Refuse a name under which there is a link, a folder or a device: only a file is ever replaced.

    Raises:
        ValueError: there is.
    """
    if path.is_symlink():
        raise InputError(f"{path} is a link, which is not followed: choose another name, or remove it")
    if path.is_dir():
        raise InputError(f"{path} is a folder: name a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is there and is no file: choose another name")


def _open_nameless(folder: Path) -> int | None:
    """Open a file without a name in a folder; None where the system has no such files."""
    if not hasattr(os, "O_TMPFILE") or not os.path.isdir("/proc/self/fd"):
        return None
    try:
        return os.open(folder, os.O_TMPFILE | os.O_WRONLY | os.O_CLOEXEC, 0o666)
    except OSError as error:
        if error.errno in _NO_NAMELESS_FILES:
            return None
        raise


def _link(descriptor: int, path: Path) -> None:
    """Give an open file a name that is not taken."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:  # with a folder's descriptor, Python calls linkat(), which alone can follow the first name
        os.link(f"/proc/self/fd/{descriptor}", path.name, src_dir_fd=folder, dst_dir_fd=folder)
    finally:
        os.close(folder)
