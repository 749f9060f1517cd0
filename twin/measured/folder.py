"""A folder of measured logs: one MCAP file each, beside a `dataset.json` that describes them."""

import dataclasses
from pathlib import Path
from typing import Any

from twin import __version__
from twin.episode import Episode
from twin.errors import InputError
from twin.files.dataset_json import (
    NAME,
    MeasuredDataset,
    read_contents,
    to_json_values,
    write_contents,
)
from twin.recording import write_episode
from twin.recording.listing import describe_episode, features_of, totals


def check_name(name: str) -> None:
    """Refuse a name that would be another folder's file, or a hidden one.

    Raises:
        ValueError: it is empty, begins with a dot, or is a path.
    """
    if not name or name.startswith(".") or "/" in name or "\\" in name:
        raise InputError(f"name = {name!r}: must be the name of a file, without folder and ending")


def write_measured(folder: Path, name: str, episode: Episode) -> Path:
    """Add a measured log to a folder and list it in the folder's `dataset.json`.

    The same CSV file may be written again, read in another way; other logs in the folder stay.

    Args:
        folder: where; it exists.
        name: of the file, without its ending.
        episode: from `read_measured_log`.

    Returns:
        The path of the MCAP file.

    Raises:
        ValueError: the name is none, the folder holds what no import made or a damaged `dataset.json`, or the
            log of another CSV file is under this name.
    """
    check_name(name)
    files = _listed(folder)
    path = folder / f"{name}.mcap"
    _refuse_to_mix(path, files, episode.metadata["file_sha256"])
    named = dataclasses.replace(episode, metadata=episode.metadata | {"name": name})
    write_episode(path, named)
    files[path.name] = {
        **describe_episode(path, named),
        "csv": episode.metadata["file"],
        "csv_sha256": episode.metadata["file_sha256"],
    }
    entries = [files[key] for key in sorted(files)]
    contents = {
        "source": "measured",
        "endotwin": __version__,
        **totals(entries),
        "features": features_of(folder, entries),
        "files": entries,
    }
    write_contents(folder, contents)
    return path


def _listed(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the entries of the logs that former imports wrote into a folder and are still there, by name.

    Raises:
        ValueError: the folder's `dataset.json` is damaged, or no import wrote it.
    """
    if not (folder / NAME).exists():
        return {}
    contents = read_contents(folder)
    if not isinstance(contents, MeasuredDataset):
        raise InputError(f"{folder} holds a dataset.json that no import wrote: choose another `folder`")
    return {file.name: to_json_values(file) for file in contents.files if (folder / file.name).is_file()}


def _refuse_to_mix(path: Path, files: dict[str, dict[str, Any]], csv_sha256: str) -> None:
    """Refuse to write over the log of another CSV file, or beside files that no import wrote."""
    if path.name in files and files[path.name]["csv_sha256"] != csv_sha256:
        raise InputError(f"{path} is the log of another CSV file: choose another `name`, or remove it")
    others = sorted(file.name for file in path.parent.glob("*.mcap") if file.name not in files)
    if others:
        raise InputError(f"{path.parent} holds {others[0]}, which no import wrote: choose another `folder`")
