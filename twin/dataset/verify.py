"""Verification of a dataset against its `dataset.json`, and replay of an episode from its recipe."""

import dataclasses
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin.dataset.card import CARD, FIGURE
from twin.dataset.episodes import VERSIONS
from twin.dataset.files import is_table, make_files
from twin.dataset.recipe import EpisodeKey, Recipe, of_each_episode
from twin.dataset.recipe_file import load_recipe, parse_recipe, resolve_alone
from twin.dataset.write import describe
from twin.episode import Episode
from twin.errors import InputError
from twin.files.bounded import sha256_of
from twin.files.dataset_json import (
    NAME,
    BenchmarkDataset,
    BenchmarkFile,
    Dataset,
    Entry,
    MeasuredFile,
    SimulatedDataset,
    SimulatedFile,
    read_contents,
    to_json_values,
)
from twin.recording import read_episode
from twin.recording.features import describe_features, recorded, wrong_statistics
from twin.recording.listing import length, totals

RULES = {
    "files": "every file that dataset.json lists is there, and no other MCAP file",
    "bytes": "every file has the size and the SHA-256 that dataset.json states",
    "readable": "every file is a whole MCAP file: each CRC, count and message",
    "length": "every file has the samples and seconds that dataset.json states",
    "quantities": "every file holds the quantities that dataset.json describes, with unit and shape",
    "statistics": "the statistics of every quantity, recomputed, are those of dataset.json",
    "origin": "the metadata of every file agrees with dataset.json: seed, signal, versions",
    "recipe": "the recipe of the folder is that of dataset.json, and every file was made from it",
    "totals": "counts and statistics of the dataset follow from those of its files",
    "tables": "every CSV table has the SHA-256 that dataset.json states",
    "card": "the card and its figure are there",
}
"""Rules by name, and the demand of each. Not every kind of dataset has a recipe, tables or a card."""

LENGTH_TOLERANCE = 1e-6  # of two equal lengths of a record [s]
_STATED = ("seed", "episode", "signal", "stroke_mm", "sheath_bend_deg", "samples", "twin")  # in metadata too


class RuleFault(str):
    """A fault of a dataset, in one line, and the name of the rule that it breaks, of `RULES`."""

    rule: str

    def __new__(cls, rule: str, text: str) -> "RuleFault":
        """Return the fault of a rule."""
        fault = super().__new__(cls, text)
        fault.rule = rule
        return fault


def verify(
    folder: Path, on_progress: Callable[[int, int], None] | None = None
) -> tuple[list[RuleFault], int]:
    """Check every file of a dataset against its `dataset.json`, by each of `RULES`.

    Returns:
        One line for each fault, and how many episodes there should be.
    """
    contents = read_contents(folder)
    files: tuple[Entry, ...] = contents.files
    faults: list[RuleFault] = []
    simulated = isinstance(contents, SimulatedDataset)
    recipe = _read_recipe(folder / "recipe.yaml") if simulated else None
    made_from = of_each_episode(recipe)[1] if isinstance(recipe, Recipe) else None
    features = {name: to_json_values(feature) for name, feature in contents.features.items()}
    for done, file in enumerate(files, start=1):
        faults += _wrong_file(folder, file, contents, features, made_from)
        if on_progress:
            on_progress(done, len(files))
    faults += _faults("totals", _wrong_totals(folder / NAME, contents))
    if isinstance(contents, SimulatedDataset) and recipe is not None:
        faults += _faults("recipe", _wrong_recipe(folder, recipe, contents))
        absent = [name for name in (CARD, FIGURE) if not (folder / name).is_file()]
        faults += _faults("card", (f"{folder / name} is missing" for name in absent))
    names = {file.name for file in files}
    others = [path for path in sorted(folder.glob("*.mcap")) if path.name not in names]
    return [*faults, *_faults("files", (f"{path} is not in dataset.json" for path in others))], len(files)


def _faults(rule: str, lines: Iterable[str]) -> list[RuleFault]:
    return [RuleFault(rule, line) for line in lines]


def _read_recipe(path: Path) -> Recipe | str:
    try:
        return load_recipe(path)
    except (FileNotFoundError, ValueError) as error:
        return str(error) if path.is_file() else f"{path} is missing"


def _wrong_file(
    folder: Path, file: Entry, contents: Dataset, features: Mapping[str, Any], made_from: str | None
) -> Iterator[RuleFault]:
    """Yield the differences of a file to its entry in `dataset.json` and to the features stated there."""
    path = folder / file.name
    if not path.is_file():
        yield RuleFault("files", f"{path} is missing")
        return
    size = path.stat().st_size
    same = size == file.bytes and sha256_of(path) == file.sha256
    table = path.with_suffix(".csv")
    if same and isinstance(file, SimulatedFile) and file.table_sha256 and not is_table(table, file):
        what = "has another SHA-256 than dataset.json states" if table.is_file() else "is missing"
        yield RuleFault("tables", f"{table} {what}")
    try:
        episode = read_episode(path)
    except (ValueError, OSError) as error:
        yield RuleFault("readable", str(error))
        return
    if not same:
        what = f"{size} bytes, dataset.json states {file.bytes}"
        other = "another SHA-256 than dataset.json states"
        yield RuleFault("bytes", f"{path} has {what if size != file.bytes else other}")
        return
    if len(episode.time) != file.samples:
        counts = f"{len(episode.time)} samples, dataset.json states {file.samples}"
        yield RuleFault("length", f"{path} has {counts}")
    if abs(length(episode) - file.seconds) > LENGTH_TOLERANCE:
        lengths = f"{length(episode):g} s, dataset.json states {file.seconds:g} s"
        yield RuleFault("length", f"{path} lasts {lengths}")
    if describe_features(episode) != {name: of for name, of in features.items() if name in file.statistics}:
        yield RuleFault("quantities", f"{path} holds other quantities than dataset.json states")
    for fault in wrong_statistics(episode, to_json_values(file)["statistics"]):
        yield RuleFault("statistics", f"{path}: {fault}, by dataset.json")
    if made_from is not None and episode.metadata.get("recipe_sha256") != made_from:
        yield RuleFault("recipe", f"{path} was made from another recipe than that of the folder")
    yield from _faults("origin", _wrong_origin(path, episode.metadata, file, contents))


def _wrong_recipe(folder: Path, recipe: Recipe | str, contents: SimulatedDataset) -> Iterator[str]:
    """Compare the recipe in the folder with that of `dataset.json`, and its episodes with the files."""
    if isinstance(recipe, str):
        yield recipe
    elif describe(recipe) != to_json_values(contents.recipe):
        yield f"{folder / 'recipe.yaml'} is another recipe than dataset.json states"
    elif [recipe.file_name(key) for key in recipe.keys] != [file.name for file in contents.files]:
        yield f"{folder / NAME}: its files are not the episodes of the recipe"


def _wrong_totals(path: Path, contents: Dataset) -> list[str]:
    """Return the figures of the dataset that do not follow from those of its files."""
    stated = to_json_values(contents)
    try:
        wanted = totals(stated["files"])
    except ArithmeticError:  # a deviation whose square is no number
        return [f"{path}: the statistics of its files cannot be combined"]
    wrong = [name for name, value in wanted.items() if stated[name] != value]
    if stated["features"].keys() != wanted["statistics"].keys():
        wrong.append("features")
    return [f"{path}: {name} of the dataset do not follow from its files" for name in wrong]


def _wrong_origin(path: Path, metadata: Mapping[str, Any], file: Entry, contents: Dataset) -> Iterator[str]:
    entry = to_json_values(file)
    stated: dict[str, Any] = {name: entry[name] for name in _STATED if name in entry}
    if isinstance(file, MeasuredFile):
        stated = {"source": "measured", "file": file.csv, "file_sha256": file.csv_sha256}
    elif isinstance(contents, SimulatedDataset | BenchmarkDataset):
        stated |= {"endotwin": contents.endotwin, "mujoco": contents.mujoco}
    if isinstance(contents, BenchmarkDataset):
        del stated["samples"]  # its metadata does not count them
        stated["seed"] = contents.recipe.seed
    for name, value in stated.items():
        if metadata.get(name) != value:
            yield f"{path}: {name} is {metadata.get(name)}, dataset.json states {value}"
    if isinstance(file, BenchmarkFile) and isinstance(contents, BenchmarkDataset):
        preset, drawn = metadata.get("preset"), contents.recipe.ranges if file.twin == "randomized" else {}
        values = preset if isinstance(preset, Mapping) else {}
        for name in sorted({*values, *contents.recipe.preset}):
            low, high = drawn.get(name, (np.inf, -np.inf))
            value, nominal = values.get(name), contents.recipe.preset.get(name)
            if value != nominal and not (isinstance(value, int | float) and low <= value <= high):
                yield f"{path}: {name} is {value}, neither that of dataset.json nor drawn from its ranges"


@dataclasses.dataclass(frozen=True)
class Replay:
    """Result of simulating a file again."""

    same: bool  # the bytes are the same
    sha256: str  # of the file
    differs: list[str]  # quantities, and by how much
    line: str  # all of it in one sentence


def replay(path: Path) -> Replay:
    """Reproduce an episode from the recipe in its file, and compare the bytes."""
    episode = read_episode(path)
    facts = episode.metadata
    if "recipe.yaml" not in episode.attachments or not {"seed", "episode"} <= set(facts):
        raise InputError(f"{path} carries no recipe: only what `endotwin generate` made can be replayed")
    try:
        recipe = resolve_alone(parse_recipe(episode.attachments["recipe.yaml"]))
        key = EpisodeKey(facts["seed"], facts["episode"])
        recipe = dataclasses.replace(recipe, seeds=(key.seed,), episodes=key.number + 1)
        recipe.check()
    except ValueError as error:
        raise InputError(f"{path}: the recipe that it carries cannot be read: {error}") from error
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
    differs = []
    before, after = ({"time_s": episode.time, **recorded(episode)} for episode in (one, other))
    for name in sorted({*before, *after}):
        if name not in before or name not in after or before[name].shape != after[name].shape:
            differs.append(f"{name} (not the same shape)")
            continue
        unequal = ~np.isclose(before[name], after[name], rtol=0, atol=0, equal_nan=True)
        if unequal.any():
            apart = np.abs(before[name] - after[name])[unequal]
            most = "missing numbers" if np.isnan(apart).all() else f"up to {np.nanmax(apart):.3g}"
            differs.append(f"{name} by {most} from sample {int(np.argwhere(unequal)[0][0])} on")
    return differs
