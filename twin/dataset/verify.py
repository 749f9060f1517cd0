"""Does a dataset hold what it says, and does its recipe make it again? Hashes, contents, replay."""

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from twin.dataset.card import CARD, FIGURE
from twin.dataset.files import OF_METADATA, file_name, make_files
from twin.dataset.recipe import EpisodeKey, of_each_episode
from twin.dataset.recipe_file import load_recipe, parse_recipe, resolve
from twin.dataset.versions import VERSIONS
from twin.dataset.write import describe, read_contents, totals
from twin.episode import Episode
from twin.files.hashes import sha256_of
from twin.recording import read_episode
from twin.recording.features import combine, describe_features, recorded, wrong_statistics


@dataclasses.dataclass(frozen=True)
class Replay:
    """What came of simulating a file again."""

    same: bool
    """Whether the bytes are the same."""
    sha256: str
    """Of the file."""
    differs: list[str]
    """The quantities that differ, and by how much."""
    line: str
    """All of it in one sentence."""


def verify(folder: Path, on_progress: Callable[[int, int], None] | None = None) -> tuple[list[str], int]:
    """Check every file of a dataset against its `dataset.json`: hash, structure, contents, statistics.

    Args:
        folder: of the dataset.
        on_progress: told how many of how many episodes are checked.

    Returns:
        One line for each fault, and how many episodes there should be.

    Raises:
        FileNotFoundError: there is no `dataset.json`.
        ValueError: it is damaged.
    """
    contents = read_contents(folder)
    entries = contents["files"]
    faults = []
    for done, entry in enumerate(entries, start=1):
        try:
            faults += _faults(folder, entry, contents)
        except (KeyError, TypeError, AttributeError):
            faults.append(f"{folder / entry['name']}: what dataset.json says of it is damaged")
        if on_progress:
            on_progress(done, len(entries))
    faults += _wrong_totals(folder / "dataset.json", contents)
    faults += _wrong_recipe(folder, contents)
    if "recipe" in contents:
        faults += [f"{folder / name} is missing" for name in (CARD, FIGURE) if not (folder / name).is_file()]
    names = {entry["name"] for entry in entries}
    faults += [
        f"{path} is not in dataset.json" for path in sorted(folder.glob("*.mcap")) if path.name not in names
    ]
    return faults, len(entries)


def _faults(folder: Path, entry: dict[str, Any], contents: dict[str, Any]) -> list[str]:
    path = folder / entry["name"]
    if not path.is_file():
        return [f"{path} is missing"]
    same = sha256_of(path) == entry["sha256"]
    faults = _wrong_table(path.with_suffix(".csv"), entry) if same else []
    try:
        episode = read_episode(path)
    except (ValueError, OSError) as error:
        return [*faults, str(error)]
    if not same:
        return [f"{path} has another SHA-256 than dataset.json says"]
    if len(episode.time) != entry.get("samples", len(episode.time)):
        faults.append(f"{path} has {len(episode.time)} samples, dataset.json says {entry['samples']}")
    if "features" in contents and describe_features(episode) != contents["features"]:
        faults.append(f"{path} holds other quantities than dataset.json says")
    if "statistics" in entry:
        wrong = wrong_statistics(episode, entry["statistics"])
        faults += [f"{path}: {fault}, by dataset.json" for fault in wrong]
    if contents.get("source") != "measured":
        facts = episode.metadata
        said = {name: entry.get(name) for name in OF_METADATA} | {
            name: contents.get(name) for name in VERSIONS
        }
        faults += [
            f"{path}: {name} is {facts.get(name)}, dataset.json says {value}"
            for name, value in said.items()
            if facts.get(name) != value
        ]
    return faults


def _wrong_table(table: Path, entry: dict[str, Any]) -> list[str]:
    if "table_sha256" not in entry:
        return []
    if not table.is_file():
        return [f"{table} is missing"]
    if sha256_of(table) != entry["table_sha256"]:
        return [f"{table} has another SHA-256 than dataset.json says"]
    return []


def _wrong_recipe(folder: Path, contents: dict[str, Any]) -> list[str]:
    """Is the recipe in the folder that of `dataset.json`, and are the files those of its episodes?"""
    if "recipe" not in contents:
        return []
    path = folder / "recipe.yaml"
    try:
        recipe = load_recipe(path)
    except (FileNotFoundError, ValueError) as error:
        return [f"{path} is missing" if not path.is_file() else str(error)]
    if describe(recipe) != contents["recipe"]:
        return [f"{path} is another recipe than dataset.json says"]
    if [file_name(recipe, key) for key in recipe.keys] != [entry["name"] for entry in contents["files"]]:
        return [f"{folder / 'dataset.json'}: its files are not the episodes of the recipe"]
    return []


def _wrong_totals(path: Path, contents: dict[str, Any]) -> list[str]:
    """Do the figures of the whole dataset follow from those of its files?"""
    if contents.get("source") == "measured":  # it states none
        return []
    entries = contents["files"]
    try:
        wanted = totals(entries, contents["recipe"]["sample_time_s"])
        wanted["statistics"] = combine(entry["statistics"] for entry in entries)
    except (KeyError, TypeError, AttributeError, ArithmeticError):
        return [f"{path}: what it says of the whole dataset is damaged"]
    return [
        f"{path}: {name} of the whole dataset do not follow from its files"
        for name, value in wanted.items()
        if contents.get(name) != value
    ]


def replay(path: Path) -> Replay:
    """Make an episode again from the recipe that its file carries, and compare the bytes.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, or carries no recipe: measured, or made by other means.
    """
    episode = read_episode(path)
    facts = episode.metadata
    if "recipe.yaml" not in episode.attachments or not {"seed", "episode"} <= set(facts):
        raise ValueError(f"{path} carries no recipe: only what `endotwin generate` made can be replayed")
    try:
        recipe = resolve(parse_recipe(episode.attachments["recipe.yaml"].decode()), path.parent)
    except (ValueError, FileNotFoundError) as error:
        raise ValueError(f"{path}: the recipe that it carries cannot be read: {error}") from error
    key = EpisodeKey(facts["seed"], facts["episode"])
    if not all(type(number) is int and number >= 0 for number in (key.seed, key.number)):
        raise ValueError(
            f"{path}: seed {key.seed!r} and episode {key.number!r} are no whole numbers from 0 on"
        )
    recipe = dataclasses.replace(recipe, seeds=(key.seed,), episodes=key.number + 1)
    if of_each_episode(recipe)[0].encode() != episode.attachments["recipe.yaml"]:
        raise ValueError(f"{path}: the recipe that it carries is of another version of EndoTwin")
    with tempfile.TemporaryDirectory() as scratch:
        made = make_files(recipe, [key], Path(scratch), {}, False)[0].entry
        again = read_episode(Path(scratch) / made["name"])
    sha256 = sha256_of(path)
    if made["sha256"] == sha256:
        seconds = len(episode.time) * recipe.sample_time_s
        line = f"the same bytes again, {len(episode.time)} samples, {seconds:g} s (SHA-256 {sha256})"
        return Replay(True, sha256, [], line)
    differs = _differences(episode, again)
    reason = f"differs in {'; '.join(differs)}" if differs else "the numbers are the same, the bytes are not"
    other = [
        f"{name} {facts.get(name)} made it, here is {version}"
        for name, version in VERSIONS.items()
        if facts.get(name) != version
    ]
    return Replay(False, sha256, differs, ". ".join([reason, *other]))


def _differences(one: Episode, other: Episode) -> list[str]:
    """Which quantities differ, from which sample on, and by how much."""
    differs = []
    before, after = ({"time_s": episode.time, **recorded(episode)} for episode in (one, other))
    for name in sorted({*before, *after}):
        if name not in before or name not in after or before[name].shape != after[name].shape:
            differs.append(f"{name} (not the same shape)")
            continue
        unequal = ~((before[name] == after[name]) | (np.isnan(before[name]) & np.isnan(after[name])))
        if unequal.any():
            apart = np.abs(before[name] - after[name])[unequal]
            most = "missing numbers" if np.isnan(apart).all() else f"up to {np.nanmax(apart):.3g}"
            differs.append(f"{name} by {most} from sample {int(np.argwhere(unequal)[0][0])} on")
    return differs
