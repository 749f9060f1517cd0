"""State of an interrupted run: an `.npz` file of plain numbers, under the key of its run."""

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError
from twin.files.arrays import read_arrays
from twin.files.atomic import check_regular, write_whole
from twin.files.json_text import parse_json_object

Array = NDArray[np.float64]


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
    head = np.array(json.dumps({"endotwin": kind, "key": key, "names": list(arrays)}))
    buffer = io.BytesIO()
    np.savez(buffer, head, *(np.array(values, dtype=np.float64, order="C") for values in arrays.values()))
    write_whole(path, buffer.getvalue())


def read_state(path: Path, kind: str, key: str) -> dict[str, Array] | None:
    """Return the arrays of a state; None if there is none, or one of another run.

    A file that is damaged or no state of EndoTwin is refused, and stays as it is.
    """
    check_regular(path)
    try:
        arrays = read_arrays(path, what=f"{kind} of EndoTwin")
        head = parse_json_object(str(arrays["arr_0"]))
        if head["endotwin"] != kind:
            raise ValueError("of another kind")
        found = {name: arrays[f"arr_{number}"] for number, name in enumerate(head["names"], start=1)}
        if not all(values.dtype == np.float64 and np.isfinite(values).all() for values in found.values()):
            raise ValueError("not finite")
        return found if head["key"] == key else None
    except MissingFileError:
        return None
    except (ValueError, TypeError, KeyError) as error:
        raise damaged_state(path, kind) from error


def damaged_state(path: Path, kind: str) -> InputError:
    """Return the error for a file that is no state of a kind, or is not what a run has written."""
    return InputError(f"{path} is no {kind} of EndoTwin, or is damaged: move it away, its name is needed")


def remove_state(path: Path, kind: str) -> None:
    """Remove a state of this kind, if there is one; anything else of that name stays."""
    read_state(path, kind, "")
    path.unlink(missing_ok=True)
