"""Arrays that each have a head, in one `.npz`: what tracks and runs of a comparison are kept in."""

import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, TypeAdapter, ValidationError

from twin.errors import InputError
from twin.files.arrays import read_arrays
from twin.files.atomic import write_whole
from twin.files.json_text import parse_json, rule_of
from twin.files.shown import cut

Head = TypeVar("Head", bound=BaseModel)
Item = TypeVar("Item")


def write_headed(path: Path, prefix: str, heads: Sequence[BaseModel], arrays: Sequence[NDArray[Any]]) -> None:
    """Write arrays, each under `prefix` and its number, whole or not at all.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    held = {f"{prefix}_{number}": array for number, array in enumerate(arrays)}
    told = np.array(json.dumps([head.model_dump() for head in heads]))
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, heads=told, **held)
    write_whole(path, buffer.getvalue())


def read_headed(
    path: Path,
    prefix: str,
    heads: TypeAdapter[list[Head]],
    item: Callable[[Head, NDArray[Any]], Item],
    what: str,
    most_bytes: int,
) -> list[Item]:
    """Read what `write_headed` wrote.

    Args:
        path: of the file.
        prefix: of the names of the arrays.
        heads: what heads must be.
        item: makes what is returned of a head and its array; raises `ValueError` where they do not fit.
        what: should be in the file, for messages.
        most_bytes: limit of the file, packed and unpacked.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds something else, or is damaged.
    """
    arrays = read_arrays(path, most_bytes, what)
    try:
        told = heads.validate_python(parse_json(str(arrays["heads"])))
        return [item(head, arrays[f"{prefix}_{number}"]) for number, head in enumerate(told)]
    except KeyError as error:
        raise InputError(f"{path} holds no {what}: {cut(error)} is missing") from error
    except ValidationError as error:
        raise InputError(f"{path} holds no {what}: heads: {rule_of(error.errors()[0]['msg'])}") from None
    except ValueError as error:
        raise InputError(f"{path} holds no {what}: {cut(error)}") from error
