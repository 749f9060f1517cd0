"""Run folder: its configuration, its learning curve and the processor time that it took."""

import contextlib
import csv
import io
import json
import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field

from twin.errors import InputError
from twin.files.atomic import claim, write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.json_text import read_json, validated
from twin.files.shown import cut
from twin.files.yaml_text import parse_yaml, read_yaml

CONFIGURATION_FILE = "config.yaml"
CURVE_FILE = "progress.csv"
CHECKPOINT_FILE = "checkpoint.state"
COST_FILE = "cost.json"
_MOST_BYTES = 2**20
_ABSENT = object()


@contextlib.contextmanager
def open_run(
    folder: Path, configuration: dict[str, Any], files: Sequence[str], grows: str = ""
) -> Iterator[bool]:
    """Context manager: a run folder of this configuration, in which no other process is at work.

    Yields whether the folder holds a run with a checkpoint that differs only in a smaller number `grows`; it
    stays that run until `write_configuration`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with claim(folder):
        shorter = bool(grows) and _may_grow(folder / CONFIGURATION_FILE, configuration, grows)
        if not shorter:
            claim_folder(folder, configuration, (CURVE_FILE, *files))
        yield shorter


def write_configuration(folder: Path, configuration: dict[str, Any]) -> None:
    """Write the `config.yaml` of a run, to which the folder belongs from then on."""
    write_whole(folder / CONFIGURATION_FILE, _text(configuration))


def _may_grow(path: Path, configuration: dict[str, Any], name: str) -> bool:
    """Return whether the run of a `config.yaml` differs from this one only in less of a number."""
    if path.is_symlink() or not (path.is_file() and path.with_name(CHECKPOINT_FILE).is_file()):
        return False
    if _differences(path, _text(configuration)) != [name]:
        return False
    there, wanted = (_flat(values).get(name) for values in (read_yaml(path, _MOST_BYTES), configuration))
    return isinstance(there, int) and isinstance(wanted, int) and there < wanted


def claim_folder(folder: Path, configuration: dict[str, Any], files: Sequence[str] = ()) -> None:
    """Write `config.yaml` into a run folder, or check that the run already there has this configuration.

    Without a `config.yaml`, none of the `files` that the run will make may exist.
    """
    path = folder / CONFIGURATION_FILE
    text = _text(configuration)
    if os.path.lexists(path):
        if _contents(path) != text.encode():
            names = cut(", ".join(_differences(path, text)))
            which = f" ({names})" if names else ""
            raise InputError(
                f"{folder} holds a run of another configuration{which}: choose another `folder` or remove it"
            )
        return
    for name in files:
        if os.path.lexists(folder / name):
            raise InputError(
                f"{folder} holds {name} without the {path.name} of its run: choose another `folder`"
            )
    write_whole(path, text)


def _text(configuration: dict[str, Any]) -> str:
    return yaml.safe_dump(configuration, sort_keys=False)


def _differences(path: Path, text: str) -> list[str]:
    """Return the names of the differences of two configurations, as in `training.seed`."""
    try:
        there = _flat(read_yaml(path, _MOST_BYTES))
    except ValueError:
        return []
    wanted = _flat(parse_yaml(text))
    return [name for name in wanted | there if wanted.get(name, _ABSENT) != there.get(name, _ABSENT)]


def _flat(values: Any, name: str = "") -> dict[str, Any]:
    """Return nested mappings as one, by the names of all levels."""
    if not isinstance(values, dict):
        return {name: values} if name else {}
    flat: dict[str, Any] = {}
    for key, value in values.items():
        flat |= _flat(value, f"{name}.{key}" if name else str(key))
    return flat


def _contents(path: Path) -> bytes:
    """Return the start of a file, longer than any configuration; anything but a file is refused."""
    if not stat.S_ISREG(path.lstat().st_mode):
        raise InputError(f"{path} is no file: choose another `folder`")
    with path.open("rb") as file:
        return file.read(_MOST_BYTES)


def read_progress(path: Path) -> dict[str, Any]:
    """Return `samples` and `return` of a training run, as its `progress.csv` lists them."""
    where = f"{path.parent.name}/{path.name}"
    try:
        lines = list(csv.DictReader(io.StringIO(read_limited(path, MEBIBYTE).decode())))
        curve = {
            key: np.array([float(line[name]) for line in lines])
            for key, name in (("samples", "samples"), ("return", "mean_reward"))
        }
    except (csv.Error, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{where}: {cut(error) or 'a column is missing'}") from error
    if not lines or not np.isfinite(curve["samples"]).all():
        raise InputError(f"{where} has no lines of numbers")
    return curve


class CostFile(BaseModel):
    """Contents of `cost.json`: time of one core, over all parts of a run that was stopped and went on [s]."""

    model_config = ConfigDict(frozen=True, strict=True)

    processor_s: Annotated[float, Field(ge=0, le=1e12)]


@contextlib.contextmanager
def counted_cost(folder: Path) -> Iterator[None]:
    """Context manager: the processor time of this process and its children is added to a run folder's.

    That of a process that was killed is not counted.
    """
    before, begun = read_cost(folder) or 0.0, sum(os.times()[:4])
    try:
        yield
    finally:
        cost = CostFile(processor_s=round(before + sum(os.times()[:4]) - begun, 2))
        write_whole(folder / COST_FILE, json.dumps(cost.model_dump()) + "\n")


def read_cost(folder: Path) -> float | None:
    """Return the processor time of a training run [s]; None where there is no `cost.json`."""
    path = folder / COST_FILE
    if not os.path.lexists(path):
        return None
    try:
        return validated(CostFile, read_json(path, 4096)).processor_s
    except ValueError as error:
        raise InputError(f"{path}: {str(error).removeprefix(f'{path} ')}") from error
