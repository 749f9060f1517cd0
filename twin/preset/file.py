"""Preset files: YAML of `parameter: value`, built in or from a user."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.errors import InputError, MissingFileError
from twin.files.assets import assets_folder
from twin.files.bounded import MEBIBYTE
from twin.files.shown import shown, suggestion
from twin.preset.preset import Preset
from twin.preset.sensor import KEY, SensorModel

MOST_BYTES = MEBIBYTE  # of a preset's file


def preset_names() -> list[str]:
    """Return the names of the built-in presets."""
    return sorted(path.stem for path in assets_folder().glob("*.yaml"))


def load_preset(name_or_path: str | Path) -> Preset:
    """Read a preset by its name in `assets/`, or from a YAML file.

    Two keys of the file are no parameters: `ranges` (see `twin.preset.randomization`), and `sensor`, which
    contains values of `twin.preset.sensor.SensorModel`.
    """
    name, values = read_preset_file(name_or_path)
    values.pop("ranges", None)
    try:
        sensor = values.pop(KEY, None)
        given = {} if sensor is None else SensorModel.from_dict(sensor).parameters()
        if twice := sorted(given.keys() & values.keys()):
            raise InputError(f"{KEY} and {', '.join(twice)}: choose one")
        return preset_of(name, values | given)
    except ValueError as error:
        raise InputError(f"{name_or_path}: {error}") from error


def preset_of(name: str, parameters: Mapping[str, Any]) -> Preset:
    """Build a preset from parameters by name, a `name` perhaps among them; the others keep their defaults."""
    return Preset(name=name).replace(**parameters)


def read_preset_file(name_or_path: str | Path) -> tuple[str, dict[str, Any]]:
    """Read a preset file; returns its name, without the ending, and its contents."""
    from twin.files.yaml_text import read_yaml  # here: a sensor of `twin.preset` needs no parser

    text = str(name_or_path)
    path = Path(text) if text.endswith((".yaml", ".yml")) else assets_folder() / f"{text}.yaml"
    if path.parent == assets_folder() and not path.is_file():
        names = preset_names()
        raise InputError(
            f"unknown preset {shown(text)}{suggestion(text, names)}; or give the path of a .yaml file"
        )
    try:
        values = read_yaml(path, MOST_BYTES)
    except MissingFileError as error:
        raise MissingFileError(f"no preset file {path}") from error
    if not isinstance(values, dict):
        raise InputError(f"{path} holds no preset: expected `parameter: value` lines")
    return path.stem, values
