"""Arrays in `.npz` files that others wrote: plain numbers and text, of sizes known before they are read."""

import io
import json
import math
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.json_text import parse_json, rule_of
from twin.files.shown import cut

if TYPE_CHECKING:  # plain arrays are read without it
    from pydantic import BaseModel, TypeAdapter

Head = TypeVar("Head", bound="BaseModel")
Item = TypeVar("Item")

MOST_BYTES = 256 * MEBIBYTE  # size of a file, and of all its arrays once they are unpacked [bytes]
MOST_ARRAYS = 10_000
_KINDS = "biufU"
_HEADER = 4096  # [bytes] of an array's description at most


def read_arrays(
    path: str | Path, most_bytes: int = MOST_BYTES, what: str = "arrays"
) -> Mapping[str, NDArray[Any]]:
    """Read all arrays of an `.npz` file that holds only plain numbers and text.

    `most_bytes` limits its size, and that of all arrays together; messages name `what` should be in it.
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
    """Return the array of one `.npy` file, whose size must agree with its header."""
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


def write_headed(
    path: Path, prefix: str, heads: "Sequence[BaseModel]", arrays: Sequence[NDArray[Any]]
) -> None:
    """Write arrays with a head each into one `.npz`, each under `prefix` and its number."""
    held = {f"{prefix}_{number}": array for number, array in enumerate(arrays)}
    stated = np.array(json.dumps([head.model_dump() for head in heads]))
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, heads=stated, **held)
    write_whole(path, buffer.getvalue())


def read_headed(
    path: Path,
    prefix: str,
    heads: "TypeAdapter[list[Head]]",
    item: Callable[[Head, NDArray[Any]], Item],
    what: str,
    most_bytes: int,
) -> list[Item]:
    """Read a file of `write_headed`."""
    from pydantic import ValidationError

    arrays = read_arrays(path, most_bytes, what)
    try:
        stated = heads.validate_python(parse_json(str(arrays["heads"])))
        return [item(head, arrays[f"{prefix}_{number}"]) for number, head in enumerate(stated)]
    except KeyError as error:
        raise InputError(f"{path} holds no {what}: {cut(error)} is missing") from error
    except ValidationError as error:
        raise InputError(f"{path} holds no {what}: heads: {rule_of(error.errors()[0]['msg'])}") from None
    except ValueError as error:
        raise InputError(f"{path} holds no {what}: {cut(error)}") from error
