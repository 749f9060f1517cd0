"""A folder of measured logs: one MCAP file each, beside a `dataset.json` that lists them."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from twin import __version__
from twin.episode import Episode
from twin.files.atomic import write_whole
from twin.files.hashes import sha256_of
from twin.recording import write_episode


def check_name(name: str) -> None:
    """Refuse a name that would be another folder's file, or a hidden one.

    Raises:
        ValueError: it is empty, begins with a dot, or is a path.
    """
    if not name or name.startswith(".") or "/" in name or "\\" in name:
        raise ValueError(f"--name {name!r}: must be the name of a file, without folder and ending")


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
        ValueError: the name is none, the folder holds what no import made, or the log of another CSV file is
            under this name.
    """
    check_name(name)
    files = _listed(folder)
    path = folder / f"{name}.mcap"
    _refuse_to_mix(path, files, episode.metadata["file_sha256"])
    named = dataclasses.replace(episode, metadata=episode.metadata | {"name": name})
    write_episode(path, named)
    files[path.name] = {
        "name": path.name,
        "samples": len(episode.time),
        "bend_deg": [round(float(episode.bend_deg.min()), 3), round(float(episode.bend_deg.max()), 3)],
        "csv": episode.metadata["file"],
        "csv_sha256": episode.metadata["file_sha256"],
        "sha256": sha256_of(path),
    }
    contents = {"source": "measured", "endotwin": __version__, "files": [files[key] for key in sorted(files)]}
    write_whole(folder / "dataset.json", json.dumps(contents, indent=2) + "\n")
    return path


def _listed(folder: Path) -> dict[str, dict[str, Any]]:
    """What former imports wrote into a folder and is still there, by file name."""
    path = folder / "dataset.json"
    if not path.exists():
        return {}
    try:
        held = json.loads(path.read_bytes())
        if held["source"] != "measured":
            raise ValueError("a simulated dataset")
        entries = {entry["name"]: entry for entry in held["files"]}
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"{folder} holds a dataset.json that no import wrote: choose another --out"
        ) from error
    return {name: entry for name, entry in entries.items() if (folder / name).is_file()}


def _refuse_to_mix(path: Path, files: dict[str, dict[str, Any]], csv_sha256: str) -> None:
    """Neither leave files of another origin among the logs nor write over the log of another CSV file."""
    if path.name in files and files[path.name].get("csv_sha256") != csv_sha256:
        raise ValueError(f"{path} is the log of another CSV file: choose another --name, or remove it")
    others = sorted(file.name for file in path.parent.glob("*.mcap") if file.name not in files)
    if others:
        raise ValueError(f"{path.parent} holds {others[0]}, which no import wrote: choose another --out")
