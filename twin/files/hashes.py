"""SHA-256 of a file, in full or against one that is known."""

import hashlib
from pathlib import Path


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal.

    Raises:
        FileNotFoundError: there is no such file.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def has_sha256(path: Path, sha256: str, most_bytes: int) -> bool:
    """Return whether a file has a known SHA-256; one that is larger than it can be is not read.

    Raises:
        FileNotFoundError: there is no such file.
    """
    return path.stat().st_size <= most_bytes and sha256_of(path) == sha256
