"""Keys of a recipe's file, and the rules that pydantic checks them by."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StrictInt, ValidationError

from twin.dataset.changes import SHORT_FORMS
from twin.dataset.recipe import MOST_EPISODES, MOST_GIVEN
from twin.errors import InputError
from twin.files.shown import cut, shown
from twin.measured.command import CommandFormat
from twin.measured.units import SECONDS_PER_CYCLE
from twin.preset.preset import suggestion
from twin.rendering.camera import Camera
from twin.signals.excitation import SIGNALS
from twin.simulation import PHYSICS
from twin.vision.rig import StereoRig, stereo_rig

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


def checked_keys(values: Mapping[str, Any]) -> RecipeFile:
    """Return keys and values that keep the rules.

    Raises:
        ValueError: a key is unknown, or a value is none of its kind; the line says which, and the rule.
    """
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
