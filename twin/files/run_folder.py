"""Run folder: belongs to one configuration, stated in its `config.yaml`."""

import contextlib
import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.lock import claim

CONFIGURATION_FILE = "config.yaml"
CURVE_FILE = "progress.csv"
CHECKPOINT_FILE = "checkpoint.state"
_MOST_BYTES = 2**20


@contextlib.contextmanager
def open_run(folder: Path, configuration: dict[str, Any], files: Sequence[str]) -> Iterator[None]:
    """Context manager: a run folder of this configuration, in which no other process is at work.

    Args:
        folder: made if it is not there.
        configuration: what the run depends on.
        files: that the run makes, beside `config.yaml` and `progress.csv`.

    Raises:
        ValueError: another run is at work in it, it holds one of another configuration, or files of these
            names that belong to no run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with claim(folder):
        claim_folder(folder, configuration, (CURVE_FILE, *files))
        yield


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
    text = yaml.safe_dump(configuration, sort_keys=False)
    if os.path.lexists(path):
        if _contents(path) != text.encode():
            raise InputError(
                f"{folder} holds a run of another configuration: choose another `folder` or remove it"
            )
        return
    for name in files:
        if os.path.lexists(folder / name):
            raise InputError(
                f"{folder} holds {name} without the {path.name} of its run: choose another `folder`"
            )
    write_whole(path, text)


def _contents(path: Path) -> bytes:
    """Return the start of a file, longer than any configuration; nothing of what is no file."""
    if not stat.S_ISREG(path.lstat().st_mode):
        raise InputError(f"{path} is no file: choose another `folder`")
    with path.open("rb") as file:
        return file.read(_MOST_BYTES)
