"""Atomic folder: appears under its name only when all of its files are complete."""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from twin.errors import InputError
from twin.files.atomic import temporary_name, temporary_names, write_whole
from twin.files.lock import claim

MARK = ".endotwin"
"""File that says of an unfinished folder that it is ours, and what it is to become."""


class WholeFolder:
    """Context manager: a new folder that takes its final name when the block succeeds.

    Until then it is `.NAME.XXXXXXXX.partial` beside it, made afresh, so that renaming it never crosses a file
    system. Under an exception it is removed. What a killed process has left of it is removed by the next one,
    if it carries our mark; a folder of the user's that is named alike stays as it is.

    ```
    with WholeFolder("dataset") as folder:
        (folder / "a.txt").write_text("...")
    ```
    """

    def __init__(self, path: str | Path) -> None:
        """Name the folder; nothing is created yet.

        Args:
            path: the final name.

        Raises:
            ValueError: something is there already that is no empty folder.
        """
        self.path = Path(os.path.abspath(path))  # the name of `.` is needed, symbolic links are followed
        self._claim = contextlib.ExitStack()
        if self.path.is_symlink() or (self.path.exists() and not self.path.is_dir()):
            raise InputError(f"{path} is there and is no folder: choose another name, or remove it")
        if self.path.is_dir() and any(self.path.iterdir()):
            raise InputError(f"the folder {path} is not empty: choose another name, or remove it")

    def __enter__(self) -> Path:
        """Create the folder under its temporary name and return that name.

        Raises:
            OSError: it cannot be made.
            ValueError: another process is making it.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        for left in self._left_behind():
            with claim(left):
                shutil.rmtree(left)
        self._partial = temporary_name(self.path)
        self._partial.mkdir()
        self._claim.enter_context(claim(self._partial))
        write_whole(self._partial / MARK, os.fsencode(self.path.name))
        return self._partial

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Give the folder its final name, or remove it if the block was left by an exception.

        Raises:
            OSError: the disk is full or fails, or something has appeared under the final name meanwhile; the
                error names the folder.
        """
        with self._claim:
            try:
                if kind is None:
                    self._appear()
                    return
            except OSError as failure:
                shutil.rmtree(self._partial, ignore_errors=True)
                raise self._named(failure) from failure
            shutil.rmtree(self._partial, ignore_errors=True)
        if isinstance(error, OSError) and self._is_here(error):
            raise self._named(error) from error

    def _left_behind(self) -> Iterator[Path]:
        """Yield the folders that killed processes, or running ones, have made for the same name."""
        for path in temporary_names(self.path):
            mark = path / MARK
            if path.is_symlink() or mark.is_symlink() or not mark.is_file():
                continue
            if mark.stat().st_size < 1000 and mark.read_bytes() == os.fsencode(self.path.name):
                yield path

    def _appear(self) -> None:
        (self._partial / MARK).unlink()
        for folder, _, _ in os.walk(self._partial):
            _to_disk(Path(folder))
        if self.path.is_dir():
            self.path.rmdir()  # an empty one, or this fails
        os.rename(self._partial, self.path)
        _to_disk(self.path.parent)

    def _is_here(self, error: OSError) -> bool:
        """Return True if an error concerns a file in this folder, or a file that it does not name."""
        return error.errno is not None and str(error.filename or self._partial).startswith(str(self._partial))

    def _named(self, error: OSError) -> OSError:
        return OSError(error.errno, error.strerror, str(self.path))


def _to_disk(folder: Path) -> None:
    """Flush the directory entries of a folder to disk; its files are on the disk already."""
    if os.name == "nt":  # Windows opens no folder, and needs no such flush
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
