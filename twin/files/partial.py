"""Growing file: written as it goes under the name NAME.partial, renamed to NAME when it is complete.

`atomic.WholeFile` leaves nothing of a file that was not completed. A log of what cannot be repeated must be
there after a kill and after a power cut: it has a name from its first byte on.
"""

import contextlib
import itertools
import os
from pathlib import Path

from twin.errors import InputError, MissingFileError
from twin.files.lock import lock_file
from twin.files.ours import refuse_foreign

_SUFFIX = ".partial"


class PartialFile:
    """File that grows under a name of its own, and replaces what stood under its final name at the end.

    The name is `NAME.partial`; where a killed process has left that, `NAME.partial.2` and so on: what was
    left is never overwritten.

    Attributes:
        path: the final name.
        partial: the name that it is written under.
    """

    def __init__(self, path: str | Path, sign: str) -> None:
        """Make the file, empty.

        Args:
            path: the final name.
            sign: mark of such a file (`twin.files.ours`): what stands under the final name without it is not
                replaced.

        Raises:
            FileNotFoundError: the folder does not exist.
            ValueError: the final name is taken by what is not ours, or another process writes this file.
            OSError: the file cannot be made.
        """
        self.path = Path(path)
        self._sign = sign
        if not self.path.parent.is_dir():
            raise MissingFileError(f"no folder {self.path.parent} to write {self.path.name} into")
        refuse_foreign(self.path, sign)
        self.partial, self._descriptor = _make(self.path)

    def write(self, data: bytes) -> int:
        """Append bytes, all of them; they outlive this process from then on.

        Raises:
            OSError: the disk is full or fails; the error names the file. A part may have been written.
        """
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.partial)) from error
        return len(data)

    def sync(self) -> None:
        """Wait until what was written is on the disk: it outlives a power cut from then on.

        Raises:
            OSError: the disk fails; the error names the file.
        """
        try:
            getattr(os, "fdatasync", os.fsync)(self._descriptor)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.partial)) from error

    def complete(self) -> None:
        """Give the file its final name, in the place of one that bears the sign.

        Raises:
            ValueError: what is not ours has taken the final name meanwhile; the file keeps its own.
            OSError: the disk fails; the file keeps its own name.
        """
        self.sync()
        refuse_foreign(self.path, self._sign)
        self.close()  # Windows renames no open file
        os.replace(self.partial, self.path)

    def close(self) -> None:
        """Close the file, which keeps the name that it has."""
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
            self._descriptor = -1

    def remove(self) -> None:
        """Close and remove the file."""
        self.close()
        self.partial.unlink(missing_ok=True)


def _make(path: Path) -> tuple[Path, int]:
    """Return a name that was free and the descriptor of the file made there.

    Raises:
        ValueError: another process writes a file of this final name.
    """
    for number in itertools.count(1):
        partial = path.with_name(path.name + _SUFFIX + (f".{number}" if number > 1 else ""))
        try:
            flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_CLOEXEC", 0)
            descriptor = os.open(partial, flags | getattr(os, "O_BINARY", 0), 0o666)
        except FileExistsError:
            if _in_use(partial):
                raise InputError(
                    f"another run is writing {path}: wait for it, or choose another name"
                ) from None
            continue
        lock_file(descriptor)
        return partial, descriptor
    raise AssertionError("there are names without end")


def _in_use(partial: Path) -> bool:
    """Return whether another process has a file open to write; False where a file system cannot tell."""
    try:
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        descriptor = os.open(partial, flags)
    except OSError:
        return False
    try:
        return not lock_file(descriptor)
    finally:
        os.close(descriptor)
