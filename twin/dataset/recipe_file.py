"""A recipe as a user writes it: a small YAML file, checked by pydantic, resolved into a `Recipe`."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StrictInt, ValidationError

from twin.dataset.changes import SHORT_FORMS
from twin.dataset.recipe import MOST_EPISODES, MOST_GIVEN, Interval, Recipe
from twin.errors import InputError, MissingFileError
from twin.files.bounded import read_limited
from twin.files.shown import cut, shown
from twin.files.yaml_text import MOST_BYTES, parse_yaml
from twin.measured.command import CommandFormat, read_command
from twin.measured.units import SECONDS_PER_CYCLE
from twin.preset.fidelity import at_fidelity
from twin.preset.file import load_preset, preset_of
from twin.preset.preset import Preset, suggestion
from twin.preset.randomization import Ranges, load_ranges
from twin.preset.sample_time import check_sample_time
from twin.rendering.camera import Camera
from twin.signals.excitation import SIGNALS
from twin.simulation import PHYSICS
from twin.vision.rig import StereoRig, stereo_rig

LEAST_EPISODES = 5
"""Number of episodes where a recipe does not state it, even if it has fewer combinations."""

MOST_CONDITIONS = 1000
"""Number of signals, of strokes and of bends that a recipe may list."""

Number = Annotated[float, Field(allow_inf_nan=False)]
Pair = tuple[Number, Number]
Samples = Annotated[list[Number], Field(min_length=2, max_length=MOST_GIVEN)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SensorFile(_Strict):
    """The key `sensor`; what is given goes before the preset's sensor.

    Attributes:
        variance_deg2: variance of white noise besides the preset's [deg^2].
        noise_deg: standard deviation of the noise [deg].
        resolution_deg: step of the readings [deg].
        period_s: time between two readings [s].
        latency_s: age of a reading [s].
        stereo: two cameras measure the angle instead; true, or the parameters of their rig that are not the
            usual ones. The rest of the sensor is then left out.
    """

    variance_deg2: Number = 0.1
    noise_deg: Number | None = None
    resolution_deg: Number | None = None
    period_s: Number | None = None
    latency_s: Number | None = None
    stereo: bool | dict[str, str | int | Number] = False

    @property
    def rig(self) -> StereoRig | None:
        """Rig of two cameras, if there is one.

        Raises:
            ValueError: a parameter is unknown or out of range, or another sensor is given too.
        """
        if self.stereo is False:
            return None
        others = [name for name in self.model_fields_set if name != "stereo"]
        if others:
            raise InputError(f"sensor: stereo and {', '.join(sorted(others))}: choose one")
        return stereo_rig({} if self.stereo is True else self.stereo)

    def parameters(self) -> dict[str, float]:
        """Return the parameters of the preset that are given, in SI units."""
        given = {
            "sensor_noise": None if self.noise_deg is None else float(np.radians(self.noise_deg)),
            "sensor_resolution": None
            if self.resolution_deg is None
            else float(np.radians(self.resolution_deg)),
            "sensor_period": self.period_s,
            "sensor_latency": self.latency_s,
        }
        return {name: value for name, value in given.items() if value is not None}


class CommandFile(_Strict):
    """The key `command_csv`: a recorded command, and which of its columns mean what.

    Attributes:
        file: CSV file.
        command_column: command of wire a; if not given, pull_mm or command_deg.
        command_unit: unit of the commands, if the names of their columns do not end in it.
        lateral_command_column: command of wire c.
        time_column: time or phase; if not given, time_s or phase_rad.
        time_unit: its unit, if its name does not end in it; rad for a phase.
        seconds_per_cycle: time that 2 pi of a phase take [s].
    """

    file: Path
    command_column: str | None = None
    command_unit: Literal["deg", "rad", "mm", "m"] | None = None
    lateral_command_column: str | None = None
    time_column: str | None = None
    time_unit: Literal["s", "ms", "us", "rad"] | None = None
    seconds_per_cycle: Number = SECONDS_PER_CYCLE

    @property
    def form(self) -> CommandFormat:
        """Columns and units, as the reader takes them."""
        return CommandFormat(**self.model_dump(exclude={"file"}))


def _file_alone(value: Any) -> Any:
    """Return the mapping that a path stands for."""
    return {SHORT_FORMS["command_csv"]: value} if isinstance(value, str | Path) else value


class RecipeFile(_Strict):
    """The keys of a recipe's file.

    Attributes:
        preset: name of a preset, path of a .yaml file, or parameters, the `name` among them.
        set: parameters of the preset to change, in SI units.
        randomize: draw the parameters of every episode, other than those set here, from the preset's ranges.
        ranges: draw from these ranges instead.
        episodes: number of each seed; if not given, one of each combination of signal, stroke and bend, but
            at least 5.
        seeds: seeds.
        seconds: length of an episode [s].
        sample_time_s: time between two samples [s].
        signals: kinds of signal.
        strokes_mm: lowest and highest pulling distances of wire a [mm].
        lateral_stroke_mm: lowest and highest pulling distance of wire c [mm].
        sheath_bends_deg: bend of the sheath: an angle, or the angles at the start (null for the preset's) and
            at the end [deg].
        sensor: noise, resolution, period and latency of the sensor.
        camera: rate and size of pictures.
        command_csv: recorded command to follow instead of signals: a path, or the path and its columns.
        given_pull_m: (N,) the same, as pulling distances at each sample [m].
        given_lateral_pull_m: (N,) the same of wire c [m].
        fidelity: fine, standard or fast: how finely the preset is divided, but for what is set here.
        physics: mujoco, or reduced: quasi-static, far faster, without gravity.
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
    command_csv: Annotated[CommandFile | None, BeforeValidator(_file_alone)] = None
    given_pull_m: Samples | None = None
    given_lateral_pull_m: Samples | None = None
    fidelity: str = "standard"
    physics: str = PHYSICS[0]


RESOLVED_KEYS = ("given_pull_m", "given_lateral_pull_m")
"""Keys of a recipe that is resolved, which nobody writes by hand."""

_FORMS = {
    "preset": "must be a name, the path of a .yaml file, or parameters, the `name` among them",
    "set": "must be parameters and their numbers, as in {pretension: 3}",
    "ranges": "must be parameters, each with two numbers, as in {pretension: [1, 6]}",
    "sensor": "must be keys and numbers, as in {variance_deg2: 0.1, period_s: 0.04}",
    "command_csv": "must be a CSV file, or with columns, as in {file: log.csv, command_column: knob_deg}",
    "camera": "must be keys and numbers, as in {pictures_per_second: 10, width: 320, height: 240}",
    "seeds": "must be whole numbers, as in [1, 2]",
    "signals": f"must be a list of {', '.join(SIGNALS)}",
    "strokes_mm": "must be pairs of numbers, as in [[2, 4], [-1, 1]]",
    "lateral_stroke_mm": "must be two numbers, as in [-1, 1]",
    "sheath_bends_deg": "must be angles, or pairs of a start and an end, as in [90, [0, 180]]",
}
"""Rule for each value that is more than one word."""


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
        return _resolved(_validated(values), folder)
    except (InputError, MissingFileError) as error:
        if origin is None:
            raise
        raise type(error)(f"{origin}: {error}") from error


def resolve_alone(values: Mapping[str, Any]) -> Recipe:
    """Turn keys and values into a recipe that names no file: one that another file carries.

    Raises:
        ValueError: a key or a value is wrong, or names a file.
    """
    file = _validated(values)
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


def _validated(values: Mapping[str, Any]) -> RecipeFile:
    try:
        return RecipeFile.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key, last = str(first["loc"][0]), str(first["loc"][-1])
        if first["type"] in ("extra_forbidden", "unexpected_keyword_argument", "invalid_key"):
            inside = {
                "sensor": list(SensorFile.model_fields),
                "camera": list(Camera.__dataclass_fields__),
                "command_csv": list(CommandFile.model_fields),
            }
            valid = inside.get(key, [name for name in RecipeFile.model_fields if name not in RESOLVED_KEYS])
            raise InputError(f"unknown key {shown(last)}{suggestion(last, valid)}") from None
        name, value = _place(values, first["loc"])
        rule = cut(first["msg"][0].lower() + first["msg"][1:])
        if "." not in name or key not in ("sensor", "camera", "command_csv"):
            rule = _FORMS.get(key, rule)
        raise InputError(f"{cut(name, 60)} = {shown(value)}: {rule}") from None


def _place(values: Mapping[str, Any], path: Sequence[int | str]) -> tuple[str, Any]:
    """The name of a wrong value, as in `sensor.noise_deg` or `strokes_mm[1]`, and the value."""
    name, value = "", values
    for part in path:  # some parts are not of the file: they tell which type was tried
        if isinstance(value, Mapping) and part in value:
            name, value = f"{name}.{part}" if name else str(part), value[str(part)]
        elif isinstance(value, (list, tuple)) and isinstance(part, int) and part < len(value):
            name, value = f"{name}[{part}]", value[part]
    return name, value


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
