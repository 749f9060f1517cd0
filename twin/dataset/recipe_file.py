"""A recipe as a user writes it: a small YAML file, checked and resolved into a `Recipe`."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StrictInt

from twin.dataset.recipe import MOST_EPISODES, MOST_GIVEN, Interval, Recipe
from twin.errors import InputError, MissingFileError
from twin.files.bounded import read_limited
from twin.files.json_text import validated
from twin.files.yaml_text import MOST_BYTES, parse_yaml
from twin.measured.command import CommandFormat, read_command
from twin.measured.table import SECONDS_PER_CYCLE
from twin.preset.file import load_preset, preset_of
from twin.preset.preset import Preset, at_fidelity, at_sample_time
from twin.preset.randomization import Ranges, load_ranges
from twin.rendering.camera import Camera
from twin.signals.excitation import SIGNALS
from twin.simulation import PHYSICS
from twin.vision.rig import StereoRig, stereo_rig

LEAST_EPISODES = 5  # where a recipe does not state it, even if it has fewer combinations
MOST_CONDITIONS = 1000  # signals, strokes and bends that a recipe may list
RESOLVED_KEYS = ("given_pull_m", "given_lateral_pull_m")  # written by `generate`, not by hand

Number = Annotated[float, Field(allow_inf_nan=False)]
Pair = tuple[Number, Number]
Samples = Annotated[list[Number], Field(min_length=2, max_length=MOST_GIVEN)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SensorFile(_Strict):
    """The key `sensor`; its keys override the preset's sensor."""

    variance_deg2: Number = 0.1  # variance of white noise in addition to the preset's [deg^2]
    noise_deg: Number | None = None  # standard deviation of the noise [deg]
    resolution_deg: Number | None = None  # step of the readings [deg]
    period_s: Number | None = None  # time between two readings [s]
    latency_s: Number | None = None  # age of a reading [s]
    # two cameras measure the angle instead; true, or the changed parameters of their rig. No other key goes
    # with it
    stereo: bool | dict[str, str | int | Number] = False

    @property
    def rig(self) -> StereoRig | None:
        """Rig of two cameras, if there is one."""
        if self.stereo is False:
            return None
        if others := sorted(self.model_fields_set - {"stereo"}):
            raise InputError(f"sensor: stereo and {', '.join(others)}: choose one")
        return stereo_rig({} if self.stereo is True else self.stereo)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the preset that are given, in SI units."""
        degrees = {"sensor_noise": self.noise_deg, "sensor_resolution": self.resolution_deg}
        given = {name: float(np.radians(value)) for name, value in degrees.items() if value is not None}
        seconds = {"sensor_period": self.period_s, "sensor_latency": self.latency_s}
        return given | {name: value for name, value in seconds.items() if value is not None}


class CommandFile(_Strict):
    """The key `command_csv`: a recorded command, with columns and units as in `CommandFormat`."""

    file: Path
    command_column: str | None = None
    command_unit: Literal["deg", "rad", "mm", "m"] | None = None
    lateral_command_column: str | None = None
    time_column: str | None = None
    time_unit: Literal["s", "ms", "us", "rad"] | None = None
    seconds_per_cycle: Number = SECONDS_PER_CYCLE


def _command_file(value: Any) -> Any:
    return {"file": value} if isinstance(value, str | Path) else value


class RecipeFile(_Strict):
    """The keys of a recipe's file; those that are not described here are as in `Recipe`.

    Attributes:
        preset: name of a preset, path of a .yaml file, or parameters, the `name` among them.
        set: parameters of the preset to change, in SI units.
        randomize: draw the parameters of every episode, other than those set here, from the preset's ranges.
        ranges: draw from these ranges instead.
        episodes: number of each seed; by default one of each combination of signal, stroke and bend, but at
            least 5.
        sheath_bends_deg: bend of the sheath: an angle, or the angles at the start (null for the preset's) and
            at the end [deg].
        sensor: noise, resolution, period and latency of the sensor.
        command_csv: recorded command to follow instead of signals: a path, or the path and its columns.
        given_pull_m: (N,) the same, as pulling distances at each sample [m].
        given_lateral_pull_m: (N,) the same of wire c [m].
        fidelity: fine, standard or fast: how finely the preset is divided, except what is set here.
    """

    preset: str | dict[str, Any] = "ureteroscope"
    set: dict[str, int | Number] = {}
    randomize: bool = False
    ranges: dict[str, Pair] | None = None
    episodes: StrictInt | None = None
    seeds: Annotated[list[StrictInt], Field(max_length=MOST_EPISODES)] = [0]
    seconds: Number = 60.0
    sample_time_s: Number = 0.02
    signals: Annotated[list[str], Field(max_length=MOST_CONDITIONS)] = list(SIGNALS)
    strokes_mm: Annotated[list[Pair], Field(max_length=MOST_CONDITIONS)] = [(2.0, 4.0)]
    lateral_stroke_mm: Pair | None = None
    sheath_bends_deg: Annotated[
        list[Number | tuple[Number | None, Number]], Field(max_length=MOST_CONDITIONS)
    ] = []
    sensor: SensorFile = SensorFile()
    camera: Camera | None = None
    command_csv: Annotated[CommandFile | None, BeforeValidator(_command_file)] = None
    given_pull_m: Samples | None = None
    given_lateral_pull_m: Samples | None = None
    fidelity: str = "standard"
    physics: str = PHYSICS[0]


def load_recipe(path: Path) -> Recipe:
    """Read a recipe from its YAML file; errors name the file, the key and the rule."""
    return resolve(read_recipe_file(path), path.parent, path)


def read_recipe_file(path: Path) -> dict[str, Any]:
    """Return the keys and values of a recipe's file, not yet checked."""
    try:
        content = read_limited(path, MOST_BYTES)
    except MissingFileError as error:
        raise MissingFileError(f"no recipe {path}") from error
    try:
        return parse_recipe(content)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def parse_recipe(text: str | bytes) -> dict[str, Any]:
    """Return the keys and values of the text of a recipe's file, not yet checked."""
    try:
        values = parse_yaml(text)
    except ValueError as error:
        raise InputError(f"not a YAML file: {error}") from error
    if values is None:  # only comments: every key may be left out
        return {}
    if not isinstance(values, dict):
        raise InputError("no recipe: expected `key: value` lines")
    return values


def change_recipe(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys and values of a recipe's file with some of them changed.

    A mapping among the changes, such as `set` or `sensor`, changes only the keys within it that it names.
    """
    changed = dict(values)
    for key, value in changes.items():
        former = changed.get(key) or {}
        if key == "sensor" and "stereo" in value:
            former = {}  # two cameras are another sensor
        if key == "command_csv":
            former = _command_file(former)
            changed.pop("given_pull_m", None)
            changed.pop("given_lateral_pull_m", None)
        elif key == "randomize":
            changed.pop("ranges", None)
        changed[key] = {**former, **value} if isinstance(value, Mapping) else value
    return changed


def resolve(values: Mapping[str, Any], folder: Path, origin: Path | str | None = None) -> Recipe:
    """Turn keys and values of a file into a recipe: read the preset and the command that they name."""
    try:
        return _resolved(validated(RecipeFile, values), folder)
    except (InputError, MissingFileError) as error:
        if origin is None:
            raise
        raise type(error)(f"{origin}: {error}") from error


def resolve_alone(values: Mapping[str, Any]) -> Recipe:
    """Turn keys and values into a recipe that may name no file: one that another file contains."""
    file = validated(RecipeFile, values)
    if file.command_csv is not None or file.randomize or not isinstance(file.preset, dict):
        raise InputError("it names files: a recipe within a file states every parameter and sample")
    return _resolved(file, Path())


def _resolved(file: RecipeFile, folder: Path) -> Recipe:
    preset, ranges = _preset_and_ranges(file, folder)
    changes = {**file.set, **file.sensor.parameters}
    preset = at_fidelity(preset, file.fidelity).replace(**changes)
    at_sample_time(preset, file.sample_time_s)
    own = round(float(np.degrees(preset.sheath_bend)), 9)
    bends: list[Interval] = []
    for bend in file.sheath_bends_deg:
        start, end = bend if isinstance(bend, tuple) else (bend, bend)
        bends.append((own if start is None else start, end))
    chosen = {*changes, *(["sheath_bend"] if bends else [])}
    for name in sorted(chosen & set(file.ranges or {})):
        raise InputError(f"ranges: {name} is set, or bent by sheath_bends_deg: choose one")
    given, lateral = _command(file, folder, preset)
    strokes, seconds = [*file.strokes_mm], file.seconds
    if given is not None:
        strokes = [(round(min(given) * 1e3, 9), round(max(given) * 1e3, 9))]
        seconds = len(given) * file.sample_time_s
    recipe = Recipe(
        preset=preset,
        strokes_mm=tuple(strokes),
        lateral_stroke_mm=file.lateral_stroke_mm,
        sheath_bends_deg=tuple(bends),
        ranges=ranges and ranges.without(chosen),
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
    few = 1 if given and ranges is None else LEAST_EPISODES
    episodes = max(recipe.combinations, few) if file.episodes is None else file.episodes
    recipe = dataclasses.replace(recipe, episodes=episodes)
    recipe.check()
    return recipe


def _preset_and_ranges(file: RecipeFile, folder: Path) -> tuple[Preset, Ranges | None]:
    named: str | Path | None = None
    if isinstance(file.preset, str):
        named = folder / file.preset if file.preset.endswith((".yaml", ".yml")) else file.preset
        preset = load_preset(named)
    elif isinstance(file.preset.get("name"), str):
        preset = preset_of(file.preset["name"], file.preset)
    else:
        raise InputError("preset: parameters need a `name` among them")
    if file.ranges is not None:
        if file.randomize:
            raise InputError("randomize and ranges: choose one; ranges given here are drawn from")
        return preset, Ranges(tuple((name, *ends) for name, ends in file.ranges.items()))
    if file.randomize and named is None:
        raise InputError("randomize: a preset given by its parameters states no ranges; give `ranges`")
    return preset, load_ranges(named) if file.randomize and named is not None else None


def _command(file: RecipeFile, folder: Path, preset: Preset) -> tuple[list[float] | None, list[float] | None]:
    """Return the commands of wires a and c at each sample that the file gives or names [m]."""
    if file.command_csv is None:
        return file.given_pull_m, file.given_lateral_pull_m
    for name in (*RESOLVED_KEYS, "seconds", "strokes_mm", "signals"):
        if name in file.model_fields_set and (name != "signals" or file.lateral_stroke_mm is None):
            raise InputError(f"command_csv and {name}: choose one, the recorded command determines it")
    form = CommandFormat(**file.command_csv.model_dump(exclude={"file"}))
    pull, lateral = read_command(folder / file.command_csv.file, preset, file.sample_time_s, form)
    return pull.tolist(), None if lateral is None else lateral.tolist()
