"""Verification of a dataset against its `dataset.json`, and replay of an episode from its recipe."""

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from twin.dataset.card import CARD, FIGURE
from twin.dataset.files import file_name, make_files, most_table_bytes
from twin.dataset.origin import wrong_origin
from twin.dataset.recipe import EpisodeKey, of_each_episode
from twin.dataset.recipe_file import load_recipe, parse_recipe, resolve_alone
from twin.dataset.rules import RuleFault, faults_of
from twin.dataset.versions import VERSIONS
from twin.dataset.write import describe
from twin.episode import Episode
from twin.errors import InputError
from twin.files.dataset_json import (
    NAME,
    Dataset,
    Entry,
    SimulatedDataset,
    SimulatedFile,
    read_contents,
    to_json_values,
)
from twin.files.hashes import has_sha256, sha256_of
from twin.recording import read_episode
from twin.recording.features import describe_features, recorded, wrong_statistics
from twin.recording.listing import length, totals

LENGTH_TOLERANCE = 1e-6
"""Largest difference of two lengths of a record that are one [s]."""


@dataclasses.dataclass(frozen=True)
class Replay:
    """Result of simulating a file again.

    Attributes:
        same: whether the bytes are the same.
        sha256: of the file.
        differs: the quantities that differ, and by how much, one line each.
        line: all of it in one sentence.
    """

    same: bool
    sha256: str
    differs: list[str]
    line: str


def verify(
    folder: Path, on_progress: Callable[[int, int], None] | None = None
) -> tuple[list[RuleFault], int]:
    """Check every file of a dataset against its `dataset.json`, by each of `twin.dataset.rules.RULES`.

    Args:
        folder: of the dataset: simulated, measured, or the full suite's records.
        on_progress: called with how many episodes are checked, and how many there are.

    Returns:
        One line for each fault, which knows its rule, and how many episodes there should be.

    Raises:
        FileNotFoundError: there is no `dataset.json`.
        ValueError: it is damaged, or of an older version.
    """
    contents = read_contents(folder)
    files: tuple[Entry, ...] = contents.files
    count = len(files)
    faults: list[RuleFault] = []
    made_from = _recipe_sha256(folder) if isinstance(contents, SimulatedDataset) else None
    for done, file in enumerate(files, start=1):
        faults += _wrong_file(folder, file, contents, made_from)
        if on_progress:
            on_progress(done, count)
    faults += faults_of("totals", _wrong_totals(folder / NAME, contents))
    if isinstance(contents, SimulatedDataset):
        faults += faults_of("recipe", _wrong_recipe(folder, contents))
        absent = [name for name in (CARD, FIGURE) if not (folder / name).is_file()]
        faults += faults_of("card", (f"{folder / name} is missing" for name in absent))
    names = {file.name for file in files}
    others = [path for path in sorted(folder.glob("*.mcap")) if path.name not in names]
    return [*faults, *faults_of("files", (f"{path} is not in dataset.json" for path in others))], count


def _wrong_file(folder: Path, file: Entry, contents: Dataset, made_from: str | None) -> list[RuleFault]:
    """Return in what a file is not as `dataset.json` says."""
    path = folder / file.name
    if not path.is_file():
        return [RuleFault("files", f"{path} is missing")]
    size = path.stat().st_size
    same = size == file.bytes and sha256_of(path) == file.sha256
    faults: list[RuleFault] = []
    if same and isinstance(file, SimulatedFile):
        faults += faults_of("tables", _wrong_table(path.with_suffix(".csv"), file))
    try:
        episode = read_episode(path)
    except (ValueError, OSError) as error:
        return [*faults, RuleFault("readable", str(error))]
    if size != file.bytes:
        return [RuleFault("bytes", f"{path} has {size} bytes, dataset.json says {file.bytes}")]
    if not same:
        return [RuleFault("bytes", f"{path} has another SHA-256 than dataset.json says")]
    if len(episode.time) != file.samples:
        said = f"{path} has {len(episode.time)} samples, dataset.json says {file.samples}"
        faults.append(RuleFault("length", said))
    if abs(length(episode) - file.seconds) > LENGTH_TOLERANCE:
        said = f"{path} lasts {length(episode):g} s, dataset.json says {file.seconds:g} s"
        faults.append(RuleFault("length", said))
    stated = to_json_values(contents)["features"]
    if describe_features(episode) != {name: stated.get(name) for name in stated if name in file.statistics}:
        faults.append(RuleFault("quantities", f"{path} holds other quantities than dataset.json says"))
    wrong = wrong_statistics(episode, to_json_values(file)["statistics"])
    faults += faults_of("statistics", (f"{path}: {fault}, by dataset.json" for fault in wrong))
    if made_from is not None and episode.metadata.get("recipe_sha256") != made_from:
        faults.append(RuleFault("recipe", f"{path} was made from another recipe than that of the folder"))
    return [*faults, *faults_of("origin", wrong_origin(path, episode.metadata, file, contents))]


def _recipe_sha256(folder: Path) -> str | None:
    """Return the SHA-256 of the folder's recipe as each episode states it; None if it cannot be read."""
    try:
        return of_each_episode(load_recipe(folder / "recipe.yaml"))[1]
    except (FileNotFoundError, ValueError):
        return None  # reported with the recipe


def _wrong_table(table: Path, file: SimulatedFile) -> list[str]:
    if file.table_sha256 is None:
        return []
    if not table.is_file():
        return [f"{table} is missing"]
    if not has_sha256(table, file.table_sha256, most_table_bytes(file.samples)):
        return [f"{table} has another SHA-256 than dataset.json says"]
    return []


def _wrong_recipe(folder: Path, contents: SimulatedDataset) -> list[str]:
    """Compare the recipe in the folder with that of `dataset.json`, and its episodes with the files."""
    path = folder / "recipe.yaml"
    try:
        recipe = load_recipe(path)
    except (FileNotFoundError, ValueError) as error:
        return [f"{path} is missing" if not path.is_file() else str(error)]
    if describe(recipe) != to_json_values(contents.recipe):
        return [f"{path} is another recipe than dataset.json says"]
    if [file_name(recipe, key) for key in recipe.keys] != [file.name for file in contents.files]:
        return [f"{folder / NAME}: its files are not the episodes of the recipe"]
    return []


def _wrong_totals(path: Path, contents: Dataset) -> list[str]:
    """Return which figures of the whole dataset do not follow from those of its files."""
    stated = to_json_values(contents)
    try:
        wanted = totals(stated["files"])
    except ArithmeticError:  # a deviation whose square is no number
        return [f"{path}: the statistics of its files cannot be combined"]
    wrong = [name for name, value in wanted.items() if stated[name] != value]
    if stated["features"].keys() != wanted["statistics"].keys():
        wrong.append("features")
    return [f"{path}: {name} of the whole dataset do not follow from its files" for name in wrong]


def replay(path: Path) -> Replay:
    """Make an episode again from the recipe that its file carries, and compare the bytes.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, or carries no recipe: measured, or made by other means.
    """
    episode = read_episode(path)
    facts = episode.metadata
    if "recipe.yaml" not in episode.attachments or not {"seed", "episode"} <= set(facts):
        raise InputError(f"{path} carries no recipe: only what `endotwin generate` made can be replayed")
    try:
        recipe = resolve_alone(parse_recipe(episode.attachments["recipe.yaml"]))
    except ValueError as error:
        raise InputError(f"{path}: the recipe that it carries cannot be read: {error}") from error
    key = EpisodeKey(facts["seed"], facts["episode"])
    if not all(type(number) is int and number >= 0 for number in (key.seed, key.number)):
        raise InputError(
            f"{path}: seed {key.seed!r} and episode {key.number!r} are no whole numbers from 0 on"
        )
    recipe = dataclasses.replace(recipe, seeds=(key.seed,), episodes=key.number + 1)
    if of_each_episode(recipe)[0].encode() != episode.attachments["recipe.yaml"]:
        raise InputError(f"{path}: the recipe that it carries is of another version of EndoTwin")
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
    """Quantities that differ, from which sample on, and by how much."""
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
