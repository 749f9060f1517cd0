"""Foreign files in the folder of a dataset: what a run would write over, but none of its former runs made."""

import dataclasses
import os
from pathlib import Path

from twin.dataset.card import CARD, FIGURE, card_text
from twin.dataset.files import file_name
from twin.dataset.recipe import Recipe, of_each_episode
from twin.dataset.recipe_file import load_recipe
from twin.errors import InputError
from twin.files.dataset_json import NAME, SimulatedDataset
from twin.recording import read_metadata

_ADVICE = "choose another `folder`, or move it"


def refuse_foreign_files(
    folder: Path, recipe: Recipe, former: SimulatedDataset | None, *, own_file: bool, csv: bool
) -> None:
    """Refuse, before any work, a folder with files of the names of a dataset that no run made.

    A folder is that of a run which was stopped where `generate` wrote its recipe.yaml, or where it holds an
    episode of this recipe.

    Args:
        folder: where the dataset shall be.
        recipe: what to make.
        former: what a former run says of the folder; None if none came to its end.
        own_file: whether the folder's recipe.yaml was written by the user.
        csv: whether tables are written beside the episodes.

    Raises:
        ValueError: it holds such a file, or a link of such a name.
    """
    episodes = [folder / file_name(recipe, key) for key in recipe.keys]
    tables = [path.with_suffix(".csv") for path in episodes] if csv else []
    for path in [folder / NAME, folder / CARD, folder / FIGURE, *episodes, *tables]:
        if path.is_symlink():
            raise InputError(f"{path} is a link, which `generate` did not make: {_ADVICE}")
        if path.exists() and not path.is_file():
            raise InputError(f"{path} is there and is no file: {_ADVICE}")
    there = [path for path in episodes if os.path.lexists(path)]
    if former is None and own_file:
        for path in there:
            if not _is_of(recipe, path):
                raise InputError(f"{path} is not of this recipe: {_ADVICE}")
    begun = former is not None or bool(there) or ((folder / "recipe.yaml").is_file() and not own_file)
    if not begun:  # what a run that was stopped has made is compared where it is made again
        for path in (folder / CARD, folder / FIGURE, *tables):
            if path.exists():
                raise InputError(f"{path} is there, and `generate` did not make it: {_ADVICE}")


def has_own_card(folder: Path, former: SimulatedDataset | None) -> bool:
    """Return True if the card of a former run was changed since, and must stay as it is."""
    path = folder / CARD
    if former is None or not path.is_file() or not (folder / "recipe.yaml").is_file():
        return False
    recipe = load_recipe(folder / "recipe.yaml")  # of a longer one, if that was stopped
    made = dataclasses.replace(recipe, episodes=former.recipe.episodes, seeds=tuple(former.recipe.seeds))
    return path.read_bytes() != card_text(made, former).encode()


def _is_of(recipe: Recipe, path: Path) -> bool:
    """Return True if a file is an episode of a recipe."""
    try:
        return read_metadata(path).get("recipe_sha256") == of_each_episode(recipe)[1]
    except (ValueError, OSError):
        return False
