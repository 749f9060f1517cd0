"""A file that appears under its name only when it is whole."""

import os
from pathlib import Path
from types import TracebackType
from typing import BinaryIO


class WholeFile:
    """Context manager: an open binary file that takes its final name when the block ends well.

    Until then it is `.NAME.partial` in the same folder, so that renaming it never crosses a file system.
    Under an exception that file is removed, and what stood under the final name before is left as it was.
    """

    def __init__(self, path: str | Path) -> None:
        """Name the file; nothing is opened yet.

        Args:
            path: the final name.
        """
        self.path = Path(path)
        self._partial = self.path.with_name(f".{self.path.name}.partial")

    def __enter__(self) -> BinaryIO:
        """Open the file under its temporary name.

        Raises:
            FileNotFoundError: the folder does not exist.
        """
        if not self.path.parent.is_dir():
            raise FileNotFoundError(f"no folder {self.path.parent} to write {self.path.name} into")
        self._file = self._partial.open("wb")
        return self._file

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Give the file its final name, or remove it if the block was left by an exception."""
        try:
            if kind is None:
                self._file.flush()
                # The data must be on the disk before the name is, or a power cut leaves an empty file.
                os.fsync(self._file.fileno())
                self._file.close()
                os.replace(self._partial, self.path)
        finally:
            self._file.close()
            self._partial.unlink(missing_ok=True)


def write_whole(path: str | Path, content: bytes | str) -> None:
    """Write a file, whole or not at all; text as UTF-8.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    with WholeFile(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)
