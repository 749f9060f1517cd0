"""Preset files: YAML of `parameter: value`, built in or from a user."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from twin.errors import InputError, MissingFileError
from twin.files.assets import assets_folder
from twin.preset.preset import Preset, suggestion


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
    return preset_of(name, {str(key): value for key, value in values.items() if key != "ranges"})


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


def read_preset_file(name_or_path: str | Path) -> tuple[str, dict[Any, Any]]:
    """Read a preset file; returns its name, without the ending, and its contents.

    Raises:
        ValueError: the preset is unknown, or its file is not YAML of `parameter: value`.
        FileNotFoundError: a path to a YAML file that does not exist.
    """
    text = str(name_or_path)
    path = Path(text) if text.endswith((".yaml", ".yml")) else assets_folder() / f"{text}.yaml"
    if not path.is_file():
        if path.parent == assets_folder():
            names = preset_names()
            hint = suggestion(text, names)
            raise InputError(f"unknown preset {text!r}{hint}; or give the path of a .yaml file")
        raise MissingFileError(f"no preset file {path}")
    try:
        values = yaml.safe_load(path.read_text())
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a YAML file: {str(error).splitlines()[0]}") from error
    if not isinstance(values, dict):
        raise InputError(f"{path} holds no preset: expected `parameter: value` lines")
    return path.stem, values


def _number(value: Any) -> Any:
    """Convert text such as 1e6 to a number: YAML 1.1 reads it as text without a point and a sign."""
    if isinstance(value, str):
        with contextlib.suppress(ValueError):
            return float(value)
    return value
