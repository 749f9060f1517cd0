"""Run folder: belongs to one configuration, stated in its `config.yaml`."""

import contextlib
import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from twin.errors import InputError
from twin.files.atomic import claim, write_whole
from twin.files.shown import cut
from twin.files.yaml_text import parse_yaml, read_yaml

CONFIGURATION_FILE = "config.yaml"
CURVE_FILE = "progress.csv"
CHECKPOINT_FILE = "checkpoint.state"
_MOST_BYTES = 2**20
_ABSENT = object()


@contextlib.contextmanager
def open_run(
    folder: Path, configuration: dict[str, Any], files: Sequence[str], grows: str = ""
) -> Iterator[bool]:
    """Context manager: a run folder of this configuration, in which no other process is at work.

    Args:
        folder: made if it is not there.
        configuration: what the run depends on.
        files: that the run makes, beside `config.yaml` and `progress.csv`.
        grows: name of a number, as in `training.episodes`: a run that has a checkpoint and differs in nothing
            but having less of it may become this one. It stays what it is until `write_configuration`.

    Yields:
        Whether it is such a shorter run.

    Raises:
        ValueError: another run is at work in it, it holds one of another configuration, or files of these
            names that belong to no run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with claim(folder):
        shorter = bool(grows) and _may_grow(folder / CONFIGURATION_FILE, configuration, grows)
        if not shorter:
            claim_folder(folder, configuration, (CURVE_FILE, *files))
        yield shorter


def write_configuration(folder: Path, configuration: dict[str, Any]) -> None:
    """Write the `config.yaml` of a run, which says from then on what the folder holds."""
    write_whole(folder / CONFIGURATION_FILE, _text(configuration))


def _may_grow(path: Path, configuration: dict[str, Any], name: str) -> bool:
    """Return whether the run of a `config.yaml` is this one but for having less of a number."""
    if path.is_symlink() or not (path.is_file() and path.with_name(CHECKPOINT_FILE).is_file()):
        return False
    if _differences(path, _text(configuration)) != [name]:
        return False
    there, wanted = (_flat(values).get(name) for values in (read_yaml(path, _MOST_BYTES), configuration))
    return isinstance(there, int) and isinstance(wanted, int) and there < wanted


def claim_folder(folder: Path, configuration: dict[str, Any], files: Sequence[str] = ()) -> None:
    """Write `config.yaml` into a run folder, or check that the run already there has this configuration.

    Args:
        folder: of the run.
        configuration: what the run depends on.
        files: that the run will make: without a `config.yaml`, one that is there is not its own.

    Raises:
        ValueError: it has another one, or the folder holds such a file.
    """
    path = folder / CONFIGURATION_FILE
    text = _text(configuration)
    if os.path.lexists(path):
        if _contents(path) != text.encode():
            names = cut(", ".join(_differences(path, text)))
            told = f" ({names})" if names else ""
            raise InputError(
                f"{folder} holds a run of another configuration{told}: choose another `folder` or remove it"
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
    """Return the names of what two configurations say otherwise, as in `training.seed`."""
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
    """Return the start of a file, longer than any configuration; nothing of what is no file."""
    if not stat.S_ISREG(path.lstat().st_mode):
        raise InputError(f"{path} is no file: choose another `folder`")
    with path.open("rb") as file:
        return file.read(_MOST_BYTES)
