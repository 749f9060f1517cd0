"""Writing a dataset: the episodes of a recipe, spread over workers, and the files that describe them."""

import dataclasses
import math
import os
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, Executor, as_completed, wait
from pathlib import Path
from typing import Any, NamedTuple

from twin.dataset.card import CARD, FIGURE, card_text, shown_keys, write_figure
from twin.dataset.episodes import VERSIONS
from twin.dataset.files import Entry, Made, make_files
from twin.dataset.recipe import Recipe, of_each_episode, to_yaml
from twin.dataset.recipe_file import load_recipe
from twin.errors import InputError
from twin.files.atomic import claim, write_whole
from twin.files.dataset_json import (
    NAME,
    SimulatedDataset,
    SimulatedFile,
    read_contents,
    to_json_values,
    write_contents,
)
from twin.recording import read_metadata
from twin.recording.listing import features_of, totals

AT_ONCE = 8  # episodes that one worker simulates together: more are hardly faster
AT_ONCE_WITH_PICTURES = 2  # pictures take longer than everything else
SAMPLES_AT_ONCE = 200_000  # that one worker holds: about 150 MB
COUNTS = ("episodes", "seeds")  # keys that may grow while the existing episodes stay the same

_ADVICE = "choose another `folder`, or move it"
_OTHER = "choose another `folder` or remove it"

OnProgress = Callable[[int, int], None]


class Written(NamedTuple):
    """Result of writing a dataset."""

    contents: dict[str, Any]  # of `dataset.json`
    kept: int  # episodes that were there already
    damage: tuple[str, ...]  # fault of each file that was replaced


def write_dataset(
    recipe: Recipe,
    folder: Path,
    executor: Executor,
    *,
    workers: int = 1,
    csv: bool = False,
    on_progress: OnProgress | None = None,
) -> Written:
    """Write the missing or damaged episodes of a dataset and, when all are complete, its description."""
    recipe.check()
    folder = Path(os.path.realpath(folder))
    folder.mkdir(parents=True, exist_ok=True)
    with claim(folder):
        former = _former(folder)
        known = {} if former is None else {file.name: file for file in former.files}
        own_file = _refuse_another_dataset(folder, recipe, former)
        _refuse_foreign_files(folder, recipe, former, own_file=own_file, csv=csv)
        own_card = _has_own_card(folder, former)
        try:
            if not own_file:
                write_whole(folder / "recipe.yaml", to_yaml(recipe))
            made = _make(recipe, folder, executor, workers, known, csv, on_progress)
            contents = _contents(recipe, folder, [one.entry for one in made])
            described = SimulatedDataset.model_validate(contents, strict=False)
            if not own_card:  # the user has changed it
                write_whole(folder / CARD, card_text(recipe, described))
            write_contents(folder, contents)
        except (OSError, BrokenExecutor) as error:
            raise _how_to_go_on(error, folder, recipe) from error
    damage = tuple(one.damage for one in made if one.damage)
    return Written(contents, sum(one.kept for one in made), damage)


def _make(
    recipe: Recipe,
    folder: Path,
    executor: Executor,
    workers: int,
    known: Mapping[str, SimulatedFile],
    csv: bool,
    on_progress: OnProgress | None,
) -> list[Made]:
    """Make all files; the figure of the card is drawn as soon as the episodes are there that it shows."""
    keys = recipe.keys
    samples = max(round(recipe.seconds / recipe.sample_time_s), 1)
    most = AT_ONCE_WITH_PICTURES if recipe.camera or recipe.stereo else AT_ONCE
    most = max(min(most, SAMPLES_AT_ONCE // samples), 1)
    rounds = math.ceil(len(keys) / (workers * most))
    size = math.ceil(len(keys) / (workers * rounds))  # even, so that no worker waits for another's last batch
    shown = {*shown_keys(recipe)}
    futures, of_figure = {}, set()
    for start in range(0, len(keys), size):
        batch = keys[start : start + size]
        names = [recipe.file_name(key) for key in batch]
        of_batch = {name: known[name] for name in names if name in known}
        future = executor.submit(make_files, recipe, batch, folder, of_batch, csv, VERSIONS)
        futures[future] = len(batch)
        if shown & {*batch}:
            of_figure.add(future)
    done = 0
    undrawn: Exception | None = None
    report = on_progress or (lambda *_: None)
    report(done, len(keys))
    try:
        for future in as_completed(futures):
            future.result()
            done += futures[future]
            report(done, len(keys))
            if of_figure and not (of_figure := of_figure - {future}):
                try:  # while the workers go on; they do not stop where it cannot be drawn
                    write_figure(folder, recipe)
                except Exception as error:
                    undrawn = error
        if undrawn is not None:
            raise undrawn
    except BaseException as error:
        running = [future for future in futures if not future.cancel()]
        if isinstance(error, Exception):
            wait(running)  # they complete the episodes that they have begun
        raise
    return [one for future in futures for one in future.result()]


def _contents(recipe: Recipe, folder: Path, files: list[Entry]) -> dict[str, Any]:
    described = {"source": "simulated", **VERSIONS, "recipe": describe(recipe), **totals(files)}
    return described | {"features": features_of(folder, files), "files": files}


def describe(recipe: Recipe) -> dict[str, Any]:
    """Return a recipe as `dataset.json` holds it: without the samples of a given command."""
    described = recipe.to_dict()
    for name in ("given_pull_m", "given_lateral_pull_m"):
        if name in described:
            described[name] = f"{len(described[name])} samples: see recipe.yaml"
    return described


def _former(folder: Path) -> SimulatedDataset | None:
    """Return the `dataset.json` of an earlier run; None if none was completed."""
    if not (folder / NAME).is_file():
        return None
    contents = read_contents(folder)
    if not isinstance(contents, SimulatedDataset):
        made_by = f"a dataset that `generate` did not make (source {contents.source})"
        raise InputError(f"{folder} holds {made_by}: {_OTHER}")
    return contents


def _refuse_another_dataset(folder: Path, recipe: Recipe, former: SimulatedDataset | None) -> bool:
    """Refuse a folder that holds episodes of another recipe or version: they would be lost or mixed in.

    Returns whether the folder's `recipe.yaml` was written by a user, and must stay as it is.
    """
    path = folder / "recipe.yaml"
    ours = {recipe.file_name(key) for key in recipe.keys}
    there = sorted(file.name for file in folder.glob("*.mcap"))
    held, wanted, seeds = {}, {}, set()
    own_file = False
    if path.is_file():
        former_recipe = load_recipe(path)
        own_file = path.read_text() != to_yaml(former_recipe)
        if own_file and former_recipe != recipe:
            raise InputError(f"{path} is not what `generate` wrote, nor this recipe: choose another `folder`")
        held, wanted, seeds = former_recipe.to_dict(), recipe.to_dict(), set(former_recipe.seeds)
    elif former is not None:
        held, wanted, seeds = to_json_values(former.recipe), describe(recipe), set(former.recipe.seeds)
    elif ours & set(there):
        raise InputError(f"{folder} holds a dataset without a recipe.yaml: {_OTHER}")
    different = [
        name for name in {**wanted, **held} if name not in COUNTS and held.get(name) != wanted.get(name)
    ]
    if not seeds <= set(recipe.seeds):
        different.append("seeds")
    if different:
        names = ", ".join(different)
        raise InputError(f"{folder} holds a dataset of another recipe (other {names}): {_OTHER}")
    for name, version in VERSIONS.items():
        if former is not None and getattr(former, name) != version:
            made_with = f"{name} {getattr(former, name)}"
            raise InputError(f"{folder} holds a dataset of {made_with}, here is {version}: {_OTHER}")
    for name in there:
        if name not in ours:
            asked = "the one episode" if len(ours) == 1 else f"the {len(ours)} episodes"
            raise InputError(f"{folder} holds {name}, which is not among {asked} asked for: {_OTHER}")
    return own_file


def _refuse_foreign_files(
    folder: Path, recipe: Recipe, former: SimulatedDataset | None, *, own_file: bool, csv: bool
) -> None:
    """Refuse, before any work, a folder with files of the names of a dataset that no run made.

    A run was stopped in a folder where `generate` wrote its recipe.yaml, or that holds an episode of this
    recipe.
    """
    episodes = [folder / recipe.file_name(key) for key in recipe.keys]
    tables = [path.with_suffix(".csv") for path in episodes] if csv else []
    for path in [folder / NAME, folder / CARD, folder / FIGURE, *episodes, *tables]:
        if path.is_symlink():
            raise InputError(f"{path} is a link, which `generate` did not make: {_ADVICE}")
        if path.exists() and not path.is_file():
            raise InputError(f"{path} is there and is no file: {_ADVICE}")
    there = [path for path in episodes if path.exists()]
    if former is None and own_file:
        for path in there:
            if not _is_of(recipe, path):
                raise InputError(f"{path} is not of this recipe: {_ADVICE}")
    begun = former is not None or bool(there) or ((folder / "recipe.yaml").is_file() and not own_file)
    if not begun:  # files of a run that was stopped are compared where they are made again
        for path in (folder / CARD, folder / FIGURE, *tables):
            if path.exists():
                raise InputError(f"{path} is there, and `generate` did not make it: {_ADVICE}")


def _is_of(recipe: Recipe, path: Path) -> bool:
    try:
        return read_metadata(path).get("recipe_sha256") == of_each_episode(recipe)[1]
    except (ValueError, OSError):
        return False


def _has_own_card(folder: Path, former: SimulatedDataset | None) -> bool:
    """Return whether the card of a former run was changed since, and must stay as it is."""
    path = folder / CARD
    if former is None or not path.is_file() or not (folder / "recipe.yaml").is_file():
        return False
    recipe = load_recipe(folder / "recipe.yaml")  # of a longer one, if that was stopped
    made = dataclasses.replace(recipe, episodes=former.recipe.episodes, seeds=tuple(former.recipe.seeds))
    return path.read_bytes() != card_text(made, former).encode()


def _how_to_go_on(error: OSError | BrokenExecutor, folder: Path, recipe: Recipe) -> Exception:
    """Return the error that states how many episodes are complete, and that the same command continues."""
    there = sum((folder / recipe.file_name(key)).is_file() for key in recipe.keys)
    rest = f"{there} of {len(recipe.keys)} episodes are complete; the same command continues"
    if isinstance(error, BrokenExecutor):
        return BrokenExecutor(f"a worker was killed, perhaps for want of memory: {rest}")
    if error.errno is None:
        return OSError(f"{error}: {rest}")
    return OSError(error.errno, f"{error.strerror}: {rest}", error.filename or str(folder))
