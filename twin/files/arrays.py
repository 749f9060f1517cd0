"""Reader of `.npz` files that others wrote: plain numbers and text, of sizes known before they are read."""

import io
import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.shown import cut

MOST_BYTES = 256 * MEBIBYTE
"""Size of a file, and of all its arrays once they are unpacked [bytes]."""
MOST_ARRAYS = 10_000
_KINDS = "biufU"
_HEADER = 4096  # [bytes] of an array's description at most


def read_arrays(
    path: str | Path, most_bytes: int = MOST_BYTES, what: str = "arrays"
) -> Mapping[str, NDArray[Any]]:
    """Read all arrays of an `.npz` file.

    Args:
        path: of the file.
        most_bytes: limit of its size, and of all arrays together.
        what: should be in it, for messages.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no regular file or no `.npz` file, is damaged, or holds more or other than plain
            arrays.
    """
    content = read_limited(path, most_bytes)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
            if len(entries) > MOST_ARRAYS:
                raise InputError(f"it has {len(entries)} arrays: at most {MOST_ARRAYS}")
            size = sum(entry.file_size for entry in entries)
            if size > most_bytes:
                raise InputError(f"it unpacks to {size} bytes: at most {most_bytes}")
            return {entry.filename.removesuffix(".npy"): _array(archive.read(entry)) for entry in entries}
    except (
        ValueError,  # of NumPy, and ours
        EOFError,
        NotImplementedError,  # a compression that is none of zlib's
        RuntimeError,  # a password
        SyntaxError,  # a description that is no Python literal
        TypeError,
        OSError,
        MemoryError,
        RecursionError,
        zlib.error,
        zipfile.BadZipFile,
    ) as error:
        raise InputError(f"{path} holds no {what}: {cut(error) or type(error).__name__}") from error


def _array(data: bytes) -> NDArray[Any]:
    """Return the array of one `.npy` file, which must be as large as it says."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise InputError(f"an array of version {version}: must be 1 or 2")
    read_header = np.lib.format.read_array_header_1_0
    if version == (2, 0):
        read_header = np.lib.format.read_array_header_2_0
    shape, _, kind = read_header(file, max_header_size=_HEADER)
    if kind.hasobject or kind.kind not in _KINDS:
        raise InputError(f"an array of {cut(kind, 40)}: numbers and text alone are read")
    size, held = math.prod(shape) * kind.itemsize, len(data) - file.tell()
    if any(length < 0 for length in shape) or size != held:
        raise InputError(f"an array of shape {cut(shape, 40)} holds {held} bytes, not {size}")
    file.seek(0)
    array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False, max_header_size=_HEADER)
    return array
