"""Schema of `dataset.json`, the file that describes a dataset, which every reader validates.

`generate`, `import` and the full suite write it; `source` names which of them, and so which keys are there.
Every key is required but those of a simulated recipe that have a default; no other key may be there.
"""

import collections
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from twin.errors import InputError, MissingFileError
from twin.files.atomic import write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.json_text import first_fault, parse_json_object
from twin.files.shown import cut, shown

NAME = "dataset.json"
MOST_BYTES = 64 * MEBIBYTE  # a dataset of 20,000 episodes stays below it

Count = Annotated[int, Field(ge=1)]
Whole = Annotated[int, Field(ge=0)]
Seconds = Annotated[float, Field(ge=0)]
Interval = tuple[float, float]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
FileName = Annotated[str, Field(pattern=r"^[^./\\\x00-\x1f\x7f][^/\\\x00-\x1f\x7f]*\.mcap$", max_length=255)]
Parameters = dict[str, int | float | str]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Statistics(_Strict):
    """Statistics of one quantity, over all its numbers; missing measurements are not counted."""

    count: Count = Field(description="how many numbers")
    max: float = Field(description="largest")
    mean: float = Field(description="mean")
    min: float = Field(description="smallest")
    std: Seconds = Field(description="standard deviation, of the population")


class FeatureFacts(_Strict):
    """Place of one quantity in the files, and its meaning."""

    topic: str = Field(description="topic of its messages")
    field: str = Field(description="field of the message; `*` stands for each of the wires a, b (, c, d)")
    unit: str = Field(description="its unit")
    shape: tuple[Whole, ...] = Field(description="shape of one sample; empty for one number")
    meaning: str = Field(description="what it is, in words")


class _File(_Strict):
    name: FileName = Field(description="name of the file")
    samples: Count = Field(description="number of samples")
    seconds: Seconds = Field(description="length [s], from the first sample to one step after the last")
    bytes: Count = Field(description="size of the file [bytes]")
    sha256: Sha256 = Field(description="SHA-256 of the file")
    statistics: dict[str, Statistics] = Field(description="statistics of each quantity in the file")


class SimulatedFile(_File):
    """Entry of `files` for an episode that `generate` simulated."""

    seed: Whole = Field(description="seed that the episode was drawn from")
    episode: Whole = Field(description="number of the episode within its seed, from 0")
    signal: str = Field(description="kind of the command's signal")
    stroke_mm: Interval = Field(description="lowest and highest pulling distance asked for [mm]")
    sheath_bend_deg: Interval | None = Field(
        description="angle that the sheath is bent by, at the start and at the end [deg]; null: the preset's"
    )
    table_sha256: Sha256 | None = Field(description="SHA-256 of the CSV table next to the file; null: none")


class MeasuredFile(_File):
    """Entry of `files` for a log that `import` read."""

    csv: str = Field(description="name of the CSV file that it was read from")
    csv_sha256: Sha256 = Field(description="SHA-256 of that CSV file")


class BenchmarkFile(_File):
    """Entry of `files` for a test record of the full suite."""

    twin: Literal[
        "nominal",
        "bending sheath",
        "randomized",
        "sheath moves suddenly",
        "tip touched",
        "wider ranges",
        "another endoscope",
    ] = Field(
        description="`nominal`: the preset, `bending sheath`: the preset, its sheath bent during the record, "
        "`randomized`: drawn from the ranges; of the suite `untrained`: `sheath moves suddenly`, "
        "`tip touched`, `wider ranges`: drawn from wider ones, `another endoscope`: another preset"
    )
    signal: str = Field(description="kind of the command's signal")
    stroke_mm: Interval = Field(description="lowest and highest pulling distance asked for [mm]")


class _Recipe(_Strict):
    preset: Parameters = Field(description="all parameters of the preset, in SI units")
    seconds: Seconds = Field(description="length of an episode [s]")
    sample_time_s: Seconds = Field(description="time between two samples [s]")


class SimulatedRecipe(_Recipe):
    """Recipe of a simulated dataset, as in its `recipe.yaml`."""

    episodes: Count = Field(description="number of episodes of each seed")
    seeds: tuple[Whole, ...] = Field(min_length=1, description="seeds")
    signals: tuple[str, ...] = Field(min_length=1, description="kinds of signal")
    strokes_mm: tuple[Interval, ...] = Field(
        min_length=1, description="lowest and highest pulling distances [mm]"
    )
    sensor: dict[str, float | dict[str, str | int | float]] = Field(
        description="`variance_deg2`: variance of the white noise [deg^2]; or `stereo`: two cameras"
    )
    ranges: dict[str, Interval] | None = Field(
        None, description="ranges that endoscopes are drawn from, in SI units; left out if none"
    )
    lateral_stroke_mm: Interval | None = Field(
        None, description="lowest and highest pulling distance of wire c [mm]; left out if none"
    )
    sheath_bends_deg: tuple[Interval, ...] = Field(
        (), description="bends of the sheath at the start and at the end [deg]; left out if the preset's"
    )
    camera: dict[str, int | float] | None = Field(
        None, description="rate and size of the pictures; left out if none"
    )
    given_pull_m: str | None = Field(
        None, description="number of samples of a recorded command; left out if none"
    )
    given_lateral_pull_m: str | None = Field(
        None, description="number of samples of a recorded lateral command; left out if none"
    )
    physics: str | None = Field(None, description="`reduced`; left out where MuJoCo simulated")


class BenchmarkRecipe(_Recipe):
    """Origin of the test records of the full suite."""

    ranges: dict[str, Interval] = Field(description="ranges that endoscopes are drawn from, in SI units")
    seed: Whole = Field(description="seed of commands and endoscopes")


_SOURCE = "what made it: `simulated` (`generate`), `measured` (`import`), `benchmark` (the full suite)"


class _Dataset(_Strict):
    source: str
    endotwin: str = Field(description="version of EndoTwin that wrote it; of `import`, the last one")
    episodes: Count = Field(description="number of files")
    seconds: Seconds = Field(description="length of all files [s]")
    bytes: Count = Field(description="size of all files [bytes]")
    features: dict[str, FeatureFacts] = Field(description="each quantity that a file holds, by name")
    statistics: dict[str, Statistics] = Field(description="statistics of each quantity over all files")


class SimulatedDataset(_Dataset):
    """A dataset that `generate` wrote."""

    source: Literal["simulated"] = Field(description=_SOURCE)
    mujoco: str = Field(description="version of MuJoCo that simulated it")
    recipe: SimulatedRecipe = Field(description="what it was made from")
    files: tuple[SimulatedFile, ...] = Field(min_length=1, description="one entry for each MCAP file")


class MeasuredDataset(_Dataset):
    """A folder of logs that `import` read."""

    source: Literal["measured"] = Field(description=_SOURCE)
    files: tuple[MeasuredFile, ...] = Field(min_length=1, description="one entry for each MCAP file")


class BenchmarkDataset(_Dataset):
    """The test records of the full suite."""

    source: Literal["benchmark"] = Field(description=_SOURCE)
    mujoco: str = Field(description="version of MuJoCo that simulated it")
    recipe: BenchmarkRecipe = Field(description="what it was made from")
    files: tuple[BenchmarkFile, ...] = Field(min_length=1, description="one entry for each MCAP file")


Entry = SimulatedFile | MeasuredFile | BenchmarkFile
Dataset = SimulatedDataset | MeasuredDataset | BenchmarkDataset

KINDS: dict[str, type[Dataset]] = {
    "simulated": SimulatedDataset,
    "measured": MeasuredDataset,
    "benchmark": BenchmarkDataset,
}
"""Schema of each `source`."""

_REMEDY = "remove it, and generate the dataset again; measured logs, import again into another folder"


def read_contents(folder: Path) -> Dataset:
    """Return the contents of the `dataset.json` of a folder."""
    path = folder / NAME
    if not folder.is_dir():
        raise MissingFileError(f"no folder {folder}")
    try:
        content = read_limited(path, MOST_BYTES)
    except MissingFileError as error:
        rest = "the dataset is not complete; generate it again to go on"
        raise MissingFileError(f"no {path}: {rest}") from error
    try:
        return parse_contents(content)
    except ValueError as error:
        raise InputError(f"{path} is damaged or of an older version: {error}") from error


def write_contents(folder: Path, values: Mapping[str, Any]) -> None:
    """Write the `dataset.json` of a folder, completely or not at all, if it fits the schema."""
    text = json.dumps(values, indent=2, allow_nan=False) + "\n"
    parse_contents(text)
    write_whole(folder / NAME, text)


def parse_contents(text: str | bytes) -> Dataset:
    """Return the contents of the text of a `dataset.json`; an error names the key, and the remedy."""
    try:
        values = parse_json_object(text, MOST_BYTES)
    except ValueError as error:
        raise InputError(f"it {error}; {_REMEDY}") from error
    rule = f"must be {', '.join(list(KINDS)[:-1])} or {list(KINDS)[-1]}"
    if "source" not in values:
        raise InputError(f"source is missing, {rule}; {_REMEDY}")
    source = values["source"]
    if not isinstance(source, str) or source not in KINDS:
        raise InputError(f"source = {shown(source)}: {rule}; {_REMEDY}")
    try:
        contents = KINDS[source].model_validate_json(text)
    except ValidationError as error:
        raise InputError(f"{first_fault(KINDS[source], error)}; {_REMEDY}") from None
    name, count = collections.Counter(file.name for file in contents.files).most_common(1)[0]
    if count > 1:
        raise InputError(f"files: {cut(name, 80)} is there twice; {_REMEDY}")
    return contents


def to_json_values(part: BaseModel) -> dict[str, Any]:
    """Return a part of the contents as the plain values of the file."""
    return part.model_dump(mode="json", exclude_unset=True)
