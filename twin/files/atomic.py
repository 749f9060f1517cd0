"""Atomic writing: a file appears under its name only when it is complete."""

import contextlib
import os
import secrets
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from twin.errors import MissingFileError


class WholeFile:
    """Context manager: an open binary file that takes its final name when the block succeeds.

    Until then it is `.NAME.XXXXXXXX.partial` in the same folder, so that renaming it never crosses a file
    system and that two processes never write into the same one. Under an exception that file is removed, and
    what stood under the final name before is left as it was.
    """

    def __init__(self, path: str | Path) -> None:
        """Name the file; nothing is opened yet.

        Args:
            path: the final name.
        """
        self.path = Path(path)
        self._partial = self.path.with_name(f".{self.path.name}.{secrets.token_hex(4)}.partial")

    def __enter__(self) -> BinaryIO:
        """Open the file under its temporary name.

        Raises:
            FileNotFoundError: the folder does not exist.
        """
        if not self.path.parent.is_dir():
            raise MissingFileError(f"no folder {self.path.parent} to write {self.path.name} into")
        self._file = self._partial.open("xb")
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
                self._file.close()
                os.replace(self._partial, self.path)
        except OSError as failure:
            raise OSError(failure.errno, failure.strerror, str(self.path)) from failure
        finally:
            with contextlib.suppress(OSError):  # closing writes what is left, which a full disk refuses again
                self._file.close()
            self._partial.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno and error.filename is None:
            raise OSError(error.errno, error.strerror, str(self.path)) from error


def write_whole(path: str | Path, content: bytes | str) -> None:
    """Write a file atomically; text as UTF-8.

    Raises:
        FileNotFoundError: the folder does not exist.
        OSError: the disk is full or fails.
    """
    with WholeFile(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def remove_partial_files(folder: Path) -> None:
    """Remove the temporary files that killed processes have left."""
    for path in folder.glob(".*.????????.partial"):
        if path.is_file():  # a folder that is being exported is named alike
            path.unlink(missing_ok=True)
