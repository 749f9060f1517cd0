"""Preset files: YAML of `parameter: value`, built in or from a user."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.errors import InputError, MissingFileError
from twin.files.assets import assets_folder
from twin.files.bounded import MEBIBYTE
from twin.files.shown import shown
from twin.files.yaml_text import MOST_DIGITS, read_yaml
from twin.preset.preset import Preset, suggestion

MOST_BYTES = MEBIBYTE
"""Size of a preset's file [bytes]."""


def preset_names() -> list[str]:
    """Return the names of the built-in presets."""
    return sorted(path.stem for path in assets_folder().glob("*.yaml"))


def load_preset(name_or_path: str | Path) -> Preset:
    """Read a preset by its name in `assets/`, or from a YAML file.

    The key `ranges` of the file is not a parameter: see `twin.preset.randomization`.

    Raises:
        ValueError: the preset is unknown, or one of its parameters is unknown or out of range.
        FileNotFoundError: a path to a YAML file that does not exist.
    """
    name, values = read_preset_file(name_or_path)
    try:
        return preset_of(name, {key: value for key, value in values.items() if key != "ranges"})
    except ValueError as error:
        raise InputError(f"{name_or_path}: {error}") from error


def preset_of(name: str, parameters: Mapping[str, Any]) -> Preset:
    """Build a preset from the parameters of a YAML file.

    Args:
        name: name of the preset, unless a `name` is among the parameters.
        parameters: by name; the others keep their defaults.

    Raises:
        ValueError: a parameter is unknown or out of range.
    """
    named = {key: value if key == "name" else _number(value) for key, value in parameters.items()}
    return Preset(name=name).replace(**named)


def read_preset_file(name_or_path: str | Path) -> tuple[str, dict[str, Any]]:
    """Read a preset file; returns its name, without the ending, and its contents.

    Raises:
        ValueError: the preset is unknown, or its file is not YAML of `parameter: value`.
        FileNotFoundError: a path to a YAML file that does not exist.
    """
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


def _number(value: Any) -> Any:
    """Convert text such as 1e6 to a number: YAML 1.1 reads it as text without a point and a sign."""
    if isinstance(value, str) and len(value) <= MOST_DIGITS:
        with contextlib.suppress(ValueError):
            return float(value)
    return value
