"""Processor time of a training, kept in `cost.json` beside what was trained."""

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.json_text import read_json, validated

COST_FILE = "cost.json"
_MOST_BYTES = 4096


class CostFile(BaseModel):
    """Contents of `cost.json`.

    Attributes:
        processor_s: time of one core, over all parts of a training that was stopped and went on [s].
    """

    model_config = ConfigDict(frozen=True, strict=True)

    processor_s: Annotated[float, Field(ge=0, le=1e12)]


@contextlib.contextmanager
def counted_cost(folder: Path) -> Iterator[None]:
    """Context manager: the processor time of this process and its children is added to a run folder's.

    What a process used that was killed is not counted, as nobody is left to write it.

    Args:
        folder: of the run, which is there.

    Raises:
        ValueError: its `cost.json` is none.
    """
    before, begun = read_cost(folder) or 0.0, _processor_s()
    try:
        yield
    finally:
        cost = CostFile(processor_s=round(before + _processor_s() - begun, 2))
        write_whole(folder / COST_FILE, json.dumps(cost.model_dump()) + "\n")


def read_cost(folder: Path) -> float | None:
    """Return the processor time of a training [s]; None where nothing says it.

    Raises:
        ValueError: its `cost.json` is no such file.
    """
    path = folder / COST_FILE
    if not os.path.lexists(path):
        return None
    values = read_json(path, _MOST_BYTES)
    try:
        return validated(CostFile, values).processor_s
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def _processor_s() -> float:
    return sum(os.times()[:4])
