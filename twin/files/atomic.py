"""Atomic writing: a file or folder takes its name when it is complete, and replaces only what EndoTwin wrote.

Until then it is `.NAME.XXXXXXXX.endotwin` in the same folder, locked. A killed process leaves that; the next
one that writes the same name removes it.
"""

import contextlib
import itertools
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from filelock import lock_descriptor

from twin.errors import InputError, MissingFileError

MADE_BY = "made by endotwin"
"""Sign of ours in pictures, films, pages and tables. JSON files are recognised by their keys."""

_ENDS = 65536  # bytes at either end of a file in which its sign is sought
_LONGEST_NAME = 200  # characters of a name in a temporary name: file systems take 255 in all
_SUFFIX = ".endotwin"
_TOKEN = re.compile("[0-9a-f]{8}")
_PAUSE = 0.05  # between two attempts to lock [s]


class WholeFile:
    """Context manager: an open binary file that takes its final name when the block succeeds.

    Under an exception, the file that had the final name before stays as it was.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.open_path = ""  # while the block runs, a path for libraries that take no open file

    def __enter__(self) -> BinaryIO:
        """Open the file; refuse a name that a link, a folder or a device has."""
        if not self.path.parent.is_dir():
            raise MissingFileError(f"no folder {self.path.parent} to write {self.path.name} into")
        check_regular(self.path)
        _remove_left_over(self.path)
        while True:
            self.open_path = str(_temporary_name(self.path))
            self._file: BinaryIO = open(self.open_path, "xb")
            # Until it is locked, another run may take it for one that was left, and remove it.
            if _lock(self._file.fileno()) is not False and os.fstat(self._file.fileno()).st_nlink:
                return self._file
            self._file.close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Rename the file, or remove it under an exception. An `OSError` names the final path."""
        try:
            if kind is None:
                self._file.flush()
                # The data must be on the disk before the name is, or a power cut leaves an empty file.
                os.fsync(self._file.fileno())
                self._file.close()  # Windows renames no open file
                os.replace(self.open_path, self.path)
        except OSError as failure:
            raise OSError(failure.errno, failure.strerror, str(self.path)) from failure
        finally:
            with contextlib.suppress(OSError):  # closing writes the rest, which a full disk refuses again
                self._file.close()
            Path(self.open_path).unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno and error.filename in (None, self.open_path):
            raise OSError(error.errno, error.strerror, str(self.path)) from error


def write_whole(path: str | Path, content: bytes | str) -> None:
    """Write a file atomically; text as UTF-8."""
    with WholeFile(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


class WholeFolder:
    """Context manager: a new folder that takes its final name when the block succeeds.

    ```
    with WholeFolder("dataset") as folder:
        (folder / "a.txt").write_text("...")
    ```
    """

    def __init__(self, path: str | Path) -> None:
        """Name the folder; refuse a name that anything but an empty folder has."""
        self.path = Path(os.path.abspath(path))  # `.` has a name too; links on the way are followed
        if self.path.is_symlink() or (self.path.exists() and not self.path.is_dir()):
            raise InputError(f"{path} is there and is no folder: choose another name, or remove it")
        if self.path.is_dir() and any(self.path.iterdir()):
            raise InputError(f"the folder {path} is not empty: choose another name, or remove it")
        self._claim = contextlib.ExitStack()

    def __enter__(self) -> Path:
        """Create the folder under its temporary name and return that; refuse if another process makes it."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        if _remove_left_over(self.path):
            raise InputError(f"another run is writing into {self.path}: wait for it, or stop it")
        self._partial = _temporary_name(self.path)
        self._partial.mkdir()
        self._claim.enter_context(claim(self._partial))
        return self._partial

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Rename the folder, or remove it under an exception. An `OSError` names the final path."""
        with self._claim:
            try:
                if kind is None:
                    if self.path.is_dir():
                        self.path.rmdir()  # an empty one, or this fails
                    os.rename(self._partial, self.path)
                    return
            except OSError as failure:
                raise OSError(failure.errno, failure.strerror, str(self.path)) from failure
            finally:
                shutil.rmtree(self._partial, ignore_errors=True)
        if isinstance(error, OSError) and error.errno is not None:
            inside = str(error.filename or self._partial).startswith(str(self._partial))
            raise OSError(
                error.errno, error.strerror, str(self.path) if inside else error.filename
            ) from error


class PartialFile:
    """File of data that cannot be recorded again: it is `NAME.partial` from its first byte on.

    A file that a killed process left is never overwritten: the next file grows as `NAME.partial.2`.
    """

    def __init__(self, path: str | Path, sign: str) -> None:
        self.path = Path(path)
        self._sign = sign
        if not self.path.parent.is_dir():
            raise MissingFileError(f"no folder {self.path.parent} to write {self.path.name} into")
        check_overwritable(self.path, sign)
        for number in itertools.count(1):
            self.partial = self.path.with_name(f"{self.path.name}.partial" + f".{number}" * (number > 1))
            try:
                self._file = open(self.partial, "xb", buffering=0)  # noqa: SIM115
                break
            except FileExistsError:
                if self.partial.is_file() and _is_free(self.partial) is False:
                    rest = "wait for it, or choose another name"
                    raise InputError(f"another run is writing {path}: {rest}") from None
        _lock(self._file.fileno())

    def write(self, data: bytes) -> int:
        """Append all bytes, which survive this process from then on. An `OSError` names the file."""
        rest = memoryview(data)
        with self._naming():
            while rest:
                rest = rest[self._file.write(rest) :]
        return len(data)

    def sync(self) -> None:
        """Flush to the disk: written bytes survive a power cut from then on."""
        with self._naming():
            os.fsync(self._file.fileno())

    def complete(self) -> None:
        """Give the file its final name; under an error it keeps its own."""
        self.sync()
        check_overwritable(self.path, self._sign)
        self.close()
        os.replace(self.partial, self.path)

    def close(self) -> None:
        """Close the file, which keeps the name that it has."""
        with contextlib.suppress(OSError):
            self._file.close()

    def remove(self) -> None:
        """Close and remove the file."""
        self.close()
        self.partial.unlink(missing_ok=True)

    @contextlib.contextmanager
    def _naming(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.partial)) from error


def check_regular(path: Path) -> None:
    """Refuse a name that a link, a folder or a device has: only a file is ever replaced."""
    if path.is_symlink():
        raise InputError(f"{path} is a link, which is not followed: choose another name, or remove it")
    if path.is_dir():
        raise InputError(f"{path} is a folder: name a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is there and is no file: choose another name")


def check_overwritable(path: Path, sign: str = MADE_BY) -> None:
    """Refuse to replace a file that does not carry a sign: it is the user's, or of another command.

    An empty file may be replaced.
    """
    check_regular(path)
    if not path.exists():
        return
    size = path.stat().st_size
    with path.open("rb") as file:
        ends = file.read(_ENDS)
        file.seek(max(size - _ENDS, 0))
        ends += file.read(_ENDS)
    if size and sign.encode() not in ends:
        raise InputError(f"{path} is there and no such command made it: move it, or choose another name")


@contextlib.contextmanager
def claim(folder: Path, wait_seconds: float = 0.0) -> Iterator[None]:
    """Context manager: an exclusive advisory lock on a folder, released when the process ends.

    Where a file system cannot lock folders (NFS, Windows), nothing keeps two runs apart.
    """
    if os.name == "nt":  # Windows opens no folder
        yield
        return
    until = time.monotonic() + wait_seconds
    while True:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            # Another folder may have taken the name while this one was waited for.
            if _lock(descriptor) is not False and os.path.samestat(os.fstat(descriptor), os.stat(folder)):
                yield
                return
        finally:
            os.close(descriptor)
        if time.monotonic() >= until:
            raise InputError(f"another run is writing into {folder}: wait for it, or stop it")
        time.sleep(_PAUSE)


def _lock(descriptor: int) -> bool | None:
    """Lock an open file or folder until it is closed.

    Returns False if another process holds the lock, None where the file system has no such locks.
    """
    try:
        return lock_descriptor(descriptor, blocking=False)
    except OSError:
        return None


def _is_free(path: Path) -> bool | None:
    """Return whether no process holds the lock of a file or folder; None where that cannot be known."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    except OSError:
        return None
    try:
        return _lock(descriptor)
    finally:
        os.close(descriptor)


def _temporary_name(path: Path) -> Path:
    """Return a hidden name in the same folder, `.NAME.XXXXXXXX.endotwin`, which no file has by chance."""
    return path.with_name(f"{_prefix(path)}{secrets.token_hex(4)}{_SUFFIX}")


def _prefix(path: Path) -> str:
    return f".{path.name[:_LONGEST_NAME]}."


def _remove_left_over(path: Path) -> bool:
    """Remove what killed processes left of a path; returns whether another process is still writing it."""
    prefix, busy = _prefix(path), False
    for name in os.listdir(path.parent):
        token = name.removeprefix(prefix).removesuffix(_SUFFIX)
        if name != f"{prefix}{token}{_SUFFIX}" or not _TOKEN.fullmatch(token):
            continue
        left = path.with_name(name)
        free = _is_free(left)
        busy = busy or free is False
        if free and left.is_dir():
            shutil.rmtree(left)
        elif free:
            left.unlink(missing_ok=True)
    return busy
