"""A recipe as a user writes it: a small YAML file, checked and resolved into a `Recipe`."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin.dataset.recipe import Interval, Recipe
from twin.dataset.recipe_keys import RecipeFile, checked_keys
from twin.errors import InputError, MissingFileError
from twin.files.bounded import read_limited
from twin.files.yaml_text import MOST_BYTES, parse_yaml
from twin.measured.command import read_command
from twin.preset.fidelity import at_fidelity
from twin.preset.file import load_preset, preset_of
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges, load_ranges
from twin.preset.sample_time import check_sample_time

LEAST_EPISODES = 5
"""Number of episodes where a recipe does not state it, even if it has fewer combinations."""


def load_recipe(path: Path) -> Recipe:
    """Read a recipe from its YAML file.

    Raises:
        FileNotFoundError: there is no such file, or none that it names.
        ValueError: it is no recipe; the line says which key is wrong, and why.
    """
    return resolve(read_recipe_file(path), path.parent, path)


def read_recipe_file(path: Path) -> dict[str, Any]:
    """Return the keys and values of a recipe's file, not yet checked.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not YAML of `key: value`.
    """
    try:
        content = read_limited(path, MOST_BYTES)
    except MissingFileError as error:
        raise MissingFileError(f"no recipe {path}") from error
    try:
        return parse_recipe(content)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def parse_recipe(text: str | bytes) -> dict[str, Any]:
    """Return the keys and values of the text of a recipe's file, not yet checked.

    Raises:
        ValueError: it is not YAML of `key: value`.
    """
    try:
        values = parse_yaml(text)
    except ValueError as error:
        raise InputError(f"not a YAML file: {error}") from error
    if values is None:  # comments alone: every key may be left out
        return {}
    if not isinstance(values, dict):
        raise InputError("no recipe: expected `key: value` lines")
    return values


def resolve(values: Mapping[str, Any], folder: Path, origin: Path | str | None = None) -> Recipe:
    """Turn keys and values into a recipe: read the preset and the command that they name.

    Args:
        values: as in a recipe's file.
        folder: what the paths among them are relative to.
        origin: of them, which messages name, such as the file.

    Raises:
        FileNotFoundError: a file that it names does not exist.
        ValueError: a key or a value is wrong.
    """
    try:
        return _resolved(checked_keys(values), folder)
    except (InputError, MissingFileError) as error:
        if origin is None:
            raise
        raise type(error)(f"{origin}: {error}") from error


def resolve_alone(values: Mapping[str, Any]) -> Recipe:
    """Turn keys and values into a recipe that names no file: one that another file carries.

    Raises:
        ValueError: a key or a value is wrong, or names a file.
    """
    file = checked_keys(values)
    if file.command_csv is not None or file.randomize or not isinstance(file.preset, dict):
        raise InputError("it names files: a recipe that a file carries states every parameter and sample")
    return _resolved(file, Path())


def _resolved(file: RecipeFile, folder: Path) -> Recipe:
    named = _preset_name(file.preset, folder)
    preset = load_preset(named) if isinstance(named, (str, Path)) else _inline_preset(named)
    changes = {**file.set, **file.sensor.parameters()}
    preset = at_fidelity(preset, file.fidelity).replace(**changes)
    check_sample_time(preset, file.sample_time_s)
    bends = _sheath_bends(file, preset)
    chosen = set(changes) | ({"sheath_bend"} if bends else set())
    given, lateral = file.given_pull_m, file.given_lateral_pull_m
    if file.command_csv is not None:
        for name in ("given_pull_m", "given_lateral_pull_m", "seconds", "strokes_mm", "signals"):
            if name in file.model_fields_set and (name != "signals" or file.lateral_stroke_mm is None):
                raise InputError(f"command_csv and {name}: choose one, the recorded command says all of it")
        path, form = folder / file.command_csv.file, file.command_csv.form
        command = read_command(path, preset, file.sample_time_s, form)
        given = command.pull.tolist()
        lateral = None if command.lateral_pull is None else command.lateral_pull.tolist()
    strokes: list[Interval] = [(low, high) for low, high in file.strokes_mm]
    seconds = file.seconds
    if given is not None:
        strokes = [(round(min(given) * 1e3, 9), round(max(given) * 1e3, 9))]
        seconds = len(given) * file.sample_time_s
    ranges = _ranges(file, named)
    if file.ranges is not None:
        for name in sorted(chosen & set(file.ranges)):
            raise InputError(f"ranges: {name} is set, or bent by sheath_bends_deg: choose one")
    recipe = Recipe(
        preset=preset,
        strokes_mm=tuple(strokes),
        lateral_stroke_mm=file.lateral_stroke_mm,
        sheath_bends_deg=bends,
        ranges=None if ranges is None else ranges.without(chosen),
        seconds=seconds,
        sample_time_s=file.sample_time_s,
        signals=tuple(file.signals),
        sensor_variance_deg2=file.sensor.variance_deg2,
        stereo=file.sensor.rig,
        camera=file.camera,
        seeds=tuple(file.seeds),
        given_pull_m=None if given is None else tuple(given),
        given_lateral_pull_m=None if lateral is None else tuple(lateral),
        physics=file.physics,
    )
    episodes = file.episodes
    if episodes is None:
        few = 1 if given and ranges is None else LEAST_EPISODES
        episodes = max(recipe.combinations, few)
    recipe = dataclasses.replace(recipe, episodes=episodes)
    recipe.check()
    return recipe


def _preset_name(preset: str | dict[str, Any], folder: Path) -> str | Path | dict[str, Any]:
    if isinstance(preset, str) and preset.endswith((".yaml", ".yml")):
        return folder / preset
    return preset


def _inline_preset(parameters: dict[str, Any]) -> Preset:
    if not isinstance(parameters.get("name"), str):
        raise InputError("preset: parameters need a `name` among them")
    return preset_of(parameters["name"], parameters)


def _ranges(file: RecipeFile, preset: str | Path | dict[str, Any]) -> Ranges | None:
    if file.ranges is not None:
        if file.randomize:
            raise InputError("randomize and ranges: choose one; ranges given here are drawn from")
        return Ranges(tuple((name, low, high) for name, (low, high) in file.ranges.items()))
    if not file.randomize:
        return None
    if isinstance(preset, dict):
        raise InputError("randomize: a preset given by its parameters states no ranges; give `ranges`")
    return load_ranges(preset)


def _sheath_bends(file: RecipeFile, preset: Preset) -> tuple[Interval, ...]:
    own = round(float(np.degrees(preset.sheath_bend)), 9)
    bends: list[Interval] = []
    for bend in file.sheath_bends_deg:
        low, high = bend if isinstance(bend, tuple) else (bend, bend)
        bends.append((own if low is None else low, high))
    return tuple(bends)
