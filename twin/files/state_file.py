"""State of an interrupted run in one file: a line of JSON, then plain numbers; nothing in it is executed.

The line carries the mark of EndoTwin, the kind of the state, the key of the run that it belongs to, the
shapes of the arrays and the SHA-256 of everything. The arrays follow one after the other as little-endian
doubles.
"""

import hashlib
import json
import math
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.json_text import parse_json_object

Array = NDArray[np.float64]

MOST_BYTES = 256 * 2**20
_MOST_HEADER = 64 * 2**10
_MARK = b'{"endotwin": '  # the first bytes of each state
_NUMBER = np.dtype("<f8")
_HEADER_KEYS = {"endotwin", "key", "arrays", "sha256"}


def state_key(*inputs: Any) -> str:
    """Return the SHA-256 of all inputs of a run: plain values, bytes and arrays."""
    whole = hashlib.sha256()
    for value in inputs:
        if isinstance(value, np.ndarray):
            value = json.dumps([str(value.dtype), value.shape]).encode() + value.tobytes()
        text = value if isinstance(value, bytes) else json.dumps(value, sort_keys=True).encode()
        whole.update(len(text).to_bytes(8, "little") + text)
    return whole.hexdigest()


def write_state(path: Path, kind: str, key: str, arrays: Mapping[str, Array]) -> None:
    """Write a state of a kind: finite numbers, under the key of its run from `state_key`."""
    numbers = b"".join(np.ascontiguousarray(values, dtype=_NUMBER).tobytes() for values in arrays.values())
    head = {"endotwin": kind, "key": key, "arrays": {name: np.shape(of) for name, of in arrays.items()}}
    sealed = head | {"sha256": _seal(head, numbers)}
    write_whole(path, json.dumps(sealed).encode() + b"\n" + numbers)


def read_state(path: Path, kind: str, key: str) -> dict[str, Array] | None:
    """Return the arrays of a state; None if there is none, or one of another run.

    A file that is damaged or no state of EndoTwin is refused, and stays as it is.
    """
    content = _own_bytes(path, kind)
    if content is None:
        return None
    line, _, numbers = content[:_MOST_HEADER].partition(b"\n")
    numbers = content[len(line) + 1 :]
    try:
        head = parse_json_object(line, _MOST_HEADER)
        if set(head) != _HEADER_KEYS or head.pop("sha256") != _seal(head, numbers):
            raise ValueError("its checksum is another")
        if (head["endotwin"], head["key"]) != (kind, key):
            return None
        return _split(head["arrays"], numbers)
    except (ValueError, TypeError, AttributeError) as error:
        raise damaged_state(path) from error


def damaged_state(path: Path) -> InputError:
    """Return the error for a state that is ours, but is not what a run has written."""
    return InputError(f"{path} is damaged: remove it, and the run starts again")


def remove_state(path: Path, kind: str) -> None:
    """Remove a state of this kind, if there is one; anything else of that name stays."""
    if _own_bytes(path, kind) is not None:
        path.unlink(missing_ok=True)


def _own_bytes(path: Path, kind: str) -> bytes | None:
    """Return the contents of a file that carries our mark, or None if there is none."""
    foreign = InputError(f"{path} is no {kind} of EndoTwin: move it away, its name is needed")
    try:
        is_regular = stat.S_ISREG(path.lstat().st_mode)
    except FileNotFoundError:
        return None
    if not is_regular:
        raise foreign
    # A link that is put there meanwhile is not followed, a pipe not waited for.
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags), "rb") as file:
        content = file.read(MOST_BYTES + 1)
    if not content.startswith(_MARK + json.dumps(kind).encode() + b","):
        raise foreign
    if len(content) > MOST_BYTES:
        raise InputError(f"{path} is larger than {MOST_BYTES >> 20} MiB: remove it, and the run starts again")
    return content


def _split(shapes: dict[str, list[int]], numbers: bytes) -> dict[str, Array]:
    arrays, begin = {}, 0
    for name, shape in shapes.items():
        if not all(type(size) is int and 0 <= size <= MOST_BYTES for size in shape):
            raise ValueError("a shape is none")
        end = begin + _NUMBER.itemsize * math.prod(shape)
        if end > len(numbers):
            raise ValueError("it ends early")
        arrays[name] = np.frombuffer(numbers[begin:end], dtype=_NUMBER).reshape(shape).astype(np.float64)
        if not np.isfinite(arrays[name]).all():
            raise ValueError("a value is not finite")
        begin = end
    if begin != len(numbers):
        raise ValueError("it goes on after its end")
    return arrays


def _seal(head: dict[str, Any], numbers: bytes) -> str:
    return hashlib.sha256(json.dumps(head).encode() + b"\n" + numbers).hexdigest()
