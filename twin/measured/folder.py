"""A folder of measured logs: an MCAP file for each log or window, and the `dataset.json` that lists them."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin import __version__
from twin.episode import Episode
from twin.errors import InputError
from twin.files.atomic import claim
from twin.files.bounds import check_file_name
from twin.files.dataset_json import NAME, MeasuredDataset, read_contents, to_json_values, write_contents
from twin.recording import read_episode, read_metadata, write_episode
from twin.recording.features import FEATURES, describe_features
from twin.recording.listing import describe_episode, totals

WAIT_SECONDS = 60.0  # longest time that an import waits for another one into the same folder [s]
_WINDOW = "_window_{:04}"
"""Ending of the name of a window's file: its number, so that names are in the order of windows."""

_KEYS_OF_ORIGIN = ("file", "file_sha256")  # metadata: the CSV file that a log was read from
Entry = dict[str, Any]
"""Entry of one file in `dataset.json`, as `twin.files.dataset_json.MeasuredFile` describes it."""


@dataclasses.dataclass
class _Listing:
    files: dict[str, Entry]
    features: dict[str, Any]

    def add(self, path: Path, episode: Episode) -> None:
        """Add a file that is there, and holds an episode."""
        self.files[path.name] = {
            **describe_episode(path, episode),
            "csv": episode.metadata["file"],
            "csv_sha256": episode.metadata["file_sha256"],
        }
        self.features |= describe_features(episode)

    def contents(self) -> dict[str, Any]:
        """Return the contents of `dataset.json`; they do not depend on the order of imports."""
        entries = [self.files[name] for name in sorted(self.files)]
        held = {name for entry in entries for name in entry["statistics"]}
        return {
            "source": "measured",
            "endotwin": __version__,
            **totals(entries),
            "features": {one.name: self.features[one.name] for one in FEATURES if one.name in held},
            "files": entries,
        }


def write_measured(folder: Path, name: str, episode: Episode) -> Path:
    """Add a measured log to a folder and list it in the folder's `dataset.json`.

    The same CSV file may be written again, read in another way; other logs in the folder stay. Imports into
    one folder wait for each other. What a killed import has left unlisted is listed by the next.
    """
    return _write(folder, name, {name: episode})[0]


def write_windows(folder: Path, name: str, episodes: Sequence[Episode]) -> list[Path]:
    """Add the windows of a measured log to a folder as `write_measured` does, NAME_window_0000.mcap ..."""
    names = (f"{name}{_WINDOW.format(place)}" for place in range(len(episodes)))
    return _write(folder, name, dict(zip(names, episodes, strict=True)))


def _write(folder: Path, name: str, episodes: Mapping[str, Episode]) -> list[Path]:
    """Write the episodes of one CSV file and list them; its earlier files under `name` are removed."""
    check_file_name(name)
    for each in episodes:
        check_file_name(each)
    named = {
        folder / f"{each}.mcap": dataclasses.replace(episode, metadata=episode.metadata | {"name": each})
        for each, episode in episodes.items()
    }
    csv_sha256 = next(iter(episodes.values())).metadata["file_sha256"]
    with claim(folder, WAIT_SECONDS):
        listing = _listed(folder)
        _refuse_to_mix([*named], listing, csv_sha256)
        fresh = [path for path in named if not path.exists()]
        try:
            for path, episode in named.items():
                write_episode(path, episode)
                listing.add(path, episode)
        except BaseException:
            for path in fresh:
                path.unlink(missing_ok=True)
            raise
        mine = [folder / each for each, of in listing.files.items() if of["csv_sha256"] == csv_sha256]
        for path in mine:
            is_window = _is_window_of(path.stem, name) and "window" in read_metadata(path)
            if path not in named and (path.stem == name or is_window):
                del listing.files[path.name]
                path.unlink()
        write_contents(folder, listing.contents())
    return [*named]


def _is_window_of(stem: str, name: str) -> bool:
    number = stem.removeprefix(name).removeprefix(_WINDOW.format(0)[:-4])
    return number.isdecimal() and stem == name + _WINDOW.format(int(number))


def _listed(folder: Path) -> _Listing:
    index = folder / NAME
    if index.is_symlink():
        raise InputError(f"{index} is a link, which no import wrote: choose another `folder`")
    if not index.exists():
        return _Listing({}, {})
    contents = read_contents(folder)
    if not isinstance(contents, MeasuredDataset):
        raise InputError(f"{folder} holds a dataset.json that no import wrote: choose another `folder`")
    listed = to_json_values(contents)
    files = {file["name"]: file for file in listed["files"] if (folder / file["name"]).is_file()}
    for entry in files.values():
        for name in entry["statistics"]:
            if name not in listed["features"]:
                raise InputError(f"{index} is damaged: {name!r:.40} is not among its features")
    return _Listing(files, listed["features"])


def _refuse_to_mix(paths: Sequence[Path], listing: _Listing, csv_sha256: str) -> None:
    """Refuse to write over the log of another CSV file, or next to files that no import wrote."""
    folder = paths[0].parent
    unlisted = [file for file in sorted(folder.glob("*.mcap")) if file.name not in listing.files]
    metadata = {file: _metadata_of_import(file) for file in unlisted}
    for file, facts in metadata.items():
        if facts is None:
            held = f"{folder} holds {file.name}"
            raise InputError(f"{held}, which no import wrote: choose another `folder`")
    for path in paths:
        there = listing.files[path.name]["csv_sha256"] if path.name in listing.files else None
        if path in metadata:
            there = (metadata[path] or {})["file_sha256"]
        if path.is_symlink() or (there is not None and there != csv_sha256):
            raise InputError(f"{path} is the log of another CSV file: choose another `name`, or remove it")
    for file in unlisted:
        if file not in paths:
            listing.add(file, read_episode(file))


def _metadata_of_import(path: Path) -> Mapping[str, Any] | None:
    """Return the metadata of a file that an import wrote under this name; None if none did."""
    if path.is_symlink() or not path.is_file():
        return None
    try:
        facts = read_metadata(path)
    except ValueError:
        return None
    of_import = facts.get("source") == "measured" and facts.get("name") == path.stem
    return facts if of_import and all(isinstance(facts.get(key), str) for key in _KEYS_OF_ORIGIN) else None
