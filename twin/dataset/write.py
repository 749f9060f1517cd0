"""Making a dataset: the episodes of a recipe, spread over workers, and what vouches for them."""

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, Executor, as_completed, wait
from pathlib import Path
from typing import Any

from twin.dataset.card import write_card
from twin.dataset.files import Entry, Made, file_name, make_files
from twin.dataset.recipe import Recipe, to_yaml
from twin.dataset.recipe_file import load_recipe
from twin.dataset.versions import VERSIONS
from twin.files.atomic import remove_partial_files, write_whole
from twin.files.lock import claim
from twin.recording import read_episode
from twin.recording.features import combine, describe_features

AT_ONCE = 8
"""Episodes that one worker simulates together: more are hardly faster, and late to be whole."""
AT_ONCE_WITH_PICTURES = 2
"""The same with a camera: pictures take longer than all else."""
SAMPLES_AT_ONCE = 200_000
"""Samples that one worker holds at a time: about 150 MB."""

COUNTS = ("episodes", "seeds")
"""What of a recipe may grow while the episodes that are there stay the same."""

OnProgress = Callable[[int, int], None]


@dataclasses.dataclass(frozen=True)
class Written:
    """What became of a dataset."""

    contents: dict[str, Any]
    """Of `dataset.json`."""
    kept: int
    """Episodes that were there already."""
    damage: tuple[str, ...]
    """What was wrong with each file that was made anew."""


def write_dataset(
    recipe: Recipe,
    folder: Path,
    executor: Executor,
    *,
    workers: int = 1,
    csv: bool = False,
    on_progress: OnProgress | None = None,
) -> Written:
    """Write the episodes that are missing or damaged and, when all are whole, what describes them.

    Args:
        recipe: what to make.
        folder: where; it is made if it does not exist. Workers must see it under the same path.
        executor: where the work is done; the bytes do not depend on it.
        workers: how many tasks it runs at a time.
        csv: also write each episode as a table.
        on_progress: told how many of how many episodes are done.

    Returns:
        What became of it.

    Raises:
        ValueError: the recipe cannot be made, or the folder holds something else or is being written into.
        FloatingPointError: a simulation diverged.
        OSError: the disk is full or fails. Whole episodes stay, and the same call goes on from them.
        BrokenExecutor: a worker was killed; the same holds.
    """
    recipe.check()
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with claim(folder):
        former = _former(folder)
        known = {entry["name"]: entry for entry in former["files"]}
        own_file = _refuse_another_dataset(folder, recipe, former)
        try:
            if not own_file:
                write_whole(folder / "recipe.yaml", to_yaml(recipe))
            made = _make(recipe, folder, executor, workers, known, csv, on_progress)
            contents = _contents(recipe, folder, [one.entry for one in made])
            write_card(folder, recipe, contents)
            write_whole(folder / "dataset.json", json.dumps(contents, indent=2) + "\n")
        except (OSError, BrokenExecutor) as error:
            raise _how_to_go_on(error, folder, recipe) from error
        finally:
            remove_partial_files(folder)  # of workers that were killed, now or in a former run
    damage = tuple(one.damage for one in made if one.damage)
    return Written(contents, sum(one.kept for one in made), damage)


def _make(
    recipe: Recipe,
    folder: Path,
    executor: Executor,
    workers: int,
    known: Mapping[str, Entry],
    csv: bool,
    on_progress: OnProgress | None,
) -> list[Made]:
    keys = recipe.keys
    samples = max(round(recipe.seconds / recipe.sample_time_s), 1)
    most = AT_ONCE if recipe.camera is None else AT_ONCE_WITH_PICTURES
    most = max(min(most, SAMPLES_AT_ONCE // samples), 1)
    rounds = math.ceil(len(keys) / (workers * most))
    size = math.ceil(len(keys) / (workers * rounds))  # even, so that no worker waits for another's last batch
    batches = [keys[start : start + size] for start in range(0, len(keys), size)]
    futures = {}
    for batch in batches:
        names = [file_name(recipe, key) for key in batch]
        of_batch = {name: known[name] for name in names if name in known}
        futures[executor.submit(make_files, recipe, batch, folder, of_batch, csv, VERSIONS)] = len(batch)
    done = 0
    if on_progress:
        on_progress(done, len(keys))
    try:
        for future in as_completed(futures):
            future.result()
            done += futures[future]
            if on_progress:
                on_progress(done, len(keys))
    except BaseException as error:
        running = [future for future in futures if not future.cancel()]
        if isinstance(error, Exception):
            wait(running)  # what they have begun they still make whole
        raise
    return [one for future in futures for one in future.result()]


def _contents(recipe: Recipe, folder: Path, entries: list[Entry]) -> dict[str, Any]:
    """Return what `dataset.json` holds."""
    return {
        **VERSIONS,
        "recipe": describe(recipe),
        **totals(entries, recipe.sample_time_s),
        "features": describe_features(read_episode(folder / entries[0]["name"])),
        "statistics": combine(entry["statistics"] for entry in entries),
        "files": entries,
    }


def totals(entries: list[Entry], sample_time_s: float) -> dict[str, Any]:
    """Return how many episodes, seconds of record and bytes the files of a dataset are in all."""
    return {
        "episodes": len(entries),
        "seconds": round(sum(entry["samples"] for entry in entries) * sample_time_s, 9),
        "bytes": sum(entry["bytes"] for entry in entries),
    }


def describe(recipe: Recipe) -> dict[str, Any]:
    """Return a recipe as `dataset.json` holds it: without the samples of a given command."""
    described = recipe.to_dict()
    if "given_pull_m" in described:
        described["given_pull_m"] = f"{len(described['given_pull_m'])} samples: see recipe.yaml"
    return described


def read_contents(folder: Path) -> dict[str, Any]:
    """Return what the `dataset.json` of a folder holds.

    Raises:
        FileNotFoundError: there is none: the dataset is not complete, or it is no dataset.
        ValueError: it is damaged.
    """
    path = folder / "dataset.json"
    if not folder.is_dir():
        raise FileNotFoundError(f"no folder {folder}")
    if not path.is_file():
        raise FileNotFoundError(f"no {path}: the dataset is not complete; generate it again to go on")
    try:
        contents = json.loads(path.read_bytes())
        if not all(Path(entry["name"]).name == entry["name"] for entry in contents["files"]):
            raise ValueError("a file of another folder")
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is damaged: remove it, and generate the dataset again") from error
    return contents


def _former(folder: Path) -> dict[str, Any]:
    """What a former run says of the folder; nothing if none came to its end."""
    return read_contents(folder) if (folder / "dataset.json").is_file() else {"files": []}


def _refuse_another_dataset(folder: Path, recipe: Recipe, former: Mapping[str, Any]) -> bool:
    """Neither overwrite the episodes of another recipe nor leave them among the new ones.

    Returns:
        Whether the folder's `recipe.yaml` was written by a user, and must stay as it is.

    Raises:
        ValueError: the folder holds such episodes.
    """
    path, other = folder / "recipe.yaml", "choose another --out or remove it"
    ours = {file_name(recipe, key) for key in recipe.keys}
    there = sorted(file.name for file in folder.glob("*.mcap"))
    said, wanted, seeds = {}, {}, set()
    own_file = False
    if path.is_file():
        held = load_recipe(path)
        own_file = path.read_text() != to_yaml(held)
        if own_file and held != recipe:
            raise ValueError(f"{path} is not what `generate` wrote, nor this recipe: choose another --out")
        said, wanted, seeds = held.to_dict(), recipe.to_dict(), set(held.seeds)
    elif "recipe" in former:
        said, wanted = former["recipe"], describe(recipe)
        seeds = set(said.get("seeds", ()))
    elif former["files"] or ours & set(there):
        raise ValueError(f"{folder} holds a dataset without a recipe.yaml: {other}")
    different = [
        name for name in {**wanted, **said} if name not in COUNTS and said.get(name) != wanted.get(name)
    ]
    if not seeds <= set(recipe.seeds):
        different.append("seeds")
    if different:
        raise ValueError(
            f"{folder} holds a dataset of another recipe (other {', '.join(different)}): {other}"
        )
    for name, version in VERSIONS.items():
        if former.get(name, version) != version:
            raise ValueError(f"{folder} holds a dataset of {name} {former[name]}, here is {version}: {other}")
    for name in there:
        if name not in ours:
            asked = "the one episode" if len(ours) == 1 else f"the {len(ours)} episodes"
            raise ValueError(f"{folder} holds {name}, which is not among {asked} asked for: {other}")
    return own_file


def _how_to_go_on(error: OSError | BrokenExecutor, folder: Path, recipe: Recipe) -> Exception:
    """Say what is whole, and that the same command goes on."""
    there = sum((folder / file_name(recipe, key)).is_file() for key in recipe.keys)
    rest = f"{there} of {len(recipe.keys)} episodes are whole, the same command goes on from there"
    if isinstance(error, BrokenExecutor):
        return BrokenExecutor(f"a worker was killed, perhaps for want of memory: {rest}")
    if error.errno is None:
        return OSError(f"{error}: {rest}")
    return OSError(error.errno, f"{error.strerror}: {rest}", error.filename or str(folder))
