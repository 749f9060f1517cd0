"""Lines of a CSV file: from a regular file only, within limits, as UTF-8; errors name the line."""

import contextlib
import hashlib
import io
from collections.abc import Iterator
from pathlib import Path

from twin.errors import InputError, MissingFileError
from twin.files.bounded import open_regular

MOST_BYTES = 4 * 2**30
"""Largest size of a file [bytes]."""

LONGEST_LINE = 2**20
"""Largest length of a line, in characters: a file without line ends would fill the memory."""

_BUFFER = 2**20  # [bytes]
_UTF_16 = ("\udcff\udcfe", "\udcfe\udcff")  # its marks, as bytes that are no UTF-8
_FIRST_ESCAPED = 0xDC00  # code of the byte 0 where it is no UTF-8, as Python's `surrogateescape` spells it


class CsvLines:
    """Iterator over the lines of a file, with their ends, which counts and hashes what it reads.

    Attributes:
        path: the file, for messages.
        last: the line that came last.
        count: how many have come.
    """

    def __init__(self, path: Path, file: io.RawIOBase) -> None:
        """Begin before the first line.

        Args:
            path: the file, for messages.
            file: the same, open for reading.
        """
        self.path = path
        self.last = ""
        self.count = 0
        self._bytes = _CountedBytes(path, file)
        # Spreadsheets put a mark before the header, which is no part of the first name.
        self._text = io.TextIOWrapper(
            io.BufferedReader(self._bytes, _BUFFER),
            encoding="utf-8-sig",
            errors="surrogateescape",
            newline="",
        )

    @property
    def bytes_read(self) -> int:
        """Number of bytes that have been read, some of them ahead of the lines."""
        return self._bytes.count

    @property
    def sha256(self) -> str:
        """SHA-256 of what has been read, in hexadecimal: at the end, that of the file."""
        return self._bytes.hash.hexdigest()

    @property
    def is_cut_off(self) -> bool:
        """True if the last line so far has no end: it is the last of the file."""
        return not self.last.endswith(("\n", "\r"))

    def __iter__(self) -> Iterator[str]:
        """Return itself."""
        return self

    def __next__(self) -> str:
        """Return the next line.

        Raises:
            ValueError: it is too long, is no UTF-8 or holds a NUL byte.
            OSError: it cannot be read.
        """
        line = self._text.readline(LONGEST_LINE + 1)
        if not line:
            raise StopIteration
        self.last = line
        self.count += 1
        if len(line) > LONGEST_LINE:
            raise InputError(
                f"{self.path} line {self.count} has more than {LONGEST_LINE} characters: "
                f"{self.path.name:.40} is not a CSV file"
            )
        if not line.isascii():
            self._refuse_other_encodings(line)
        if "\0" in line:
            raise InputError(
                f"{self.path} is not a CSV file: line {self.count} holds a NUL byte, as binary files do, or "
                "text in UTF-16: save it as UTF-8"
            )
        return line

    def _refuse_other_encodings(self, line: str) -> None:
        if self.count == 1 and line.startswith(_UTF_16):
            raise InputError(f"{self.path} is not a CSV file in UTF-8: it is in UTF-16, save it as UTF-8")
        try:
            line.encode()
        except UnicodeEncodeError as error:
            byte = ord(line[error.start]) - _FIRST_ESCAPED
            raise InputError(
                f"{self.path} is not a CSV file in UTF-8: line {self.count} holds the byte 0x{byte:02x} of "
                "another encoding, save it as UTF-8"
            ) from error


class _CountedBytes(io.RawIOBase):
    """Bytes of an open file, counted and hashed as they are read."""

    def __init__(self, path: Path, file: io.RawIOBase) -> None:
        super().__init__()
        self.path = path
        self.file = file
        self.count = 0
        self.hash = hashlib.sha256()

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer: "bytearray | memoryview") -> int:  # type: ignore[override]
        """Fill a buffer, and return how many bytes it now holds.

        Raises:
            ValueError: the file is larger than `MOST_BYTES`.
        """
        size = self.file.readinto(buffer) or 0
        self.count += size
        if self.count > MOST_BYTES:
            raise InputError(f"{self.path} has more than {MOST_BYTES >> 30} GiB, the most that is read")
        self.hash.update(memoryview(buffer)[:size])
        return size


@contextlib.contextmanager
def open_lines(path: Path, what: str = "file") -> Iterator[CsvLines]:
    """Context manager: the lines of a regular file; it never waits for a pipe or reads a device.

    Args:
        path: the file.
        what: it is, for the message where there is none.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is a folder, a pipe or a device, or too large.
        OSError: it cannot be read.
    """
    if not path.exists():
        raise MissingFileError(f"no {what} {path}")
    if not path.is_file():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        raise InputError(f"{path} is {kind}: must be a CSV file")
    # What stands under the name may have become a pipe since: opening one must not wait either.
    with open(open_regular(path, "a CSV file"), "rb", buffering=0) as file:
        yield CsvLines(path, file)
