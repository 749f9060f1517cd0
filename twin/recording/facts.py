"""Schema of an episode's metadata: the keys that EndoTwin reads, each of its kind."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from twin.errors import InputError
from twin.files.bounds import check_name, wrong_name
from twin.files.dataset_json import Statistics
from twin.files.json_text import validated

MOST_ITEMS = 1000
LONGEST_TEXT = 1000


def _printable(name: str) -> str:
    if rule := wrong_name(name):
        raise ValueError(rule)
    return name


Name = Annotated[str, AfterValidator(_printable)]
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
Whole = Annotated[int, Field(ge=0, le=2**128)]
Number = Annotated[float, Field(ge=-1e300, le=1e300)]
Positive = Annotated[float, Field(gt=0, le=1e9)]
Length = Annotated[float, Field(ge=0, le=1e9)]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class PresetFacts(BaseModel):
    """Parameters of an endoscope among the metadata of an episode, those that its pictures need."""

    model_config = ConfigDict(extra="allow", strict=True)
    __pydantic_extra__: dict[str, Number | Name]

    name: Name | None = None
    vertebrae: Annotated[int, Field(ge=0, le=10_000)] | None = None
    bending_planes: Literal[1, 2] | None = None
    section_length: Length | None = None
    wire_offset: Length | None = None
    sheath_length: Length | None = None
    pulley_radius: Positive | None = None


class EpisodeFacts(BaseModel):
    """Metadata of an episode, as far as EndoTwin reads it; others may be added."""

    model_config = ConfigDict(extra="allow", strict=True)

    preset: Any = None  # parameters of the endoscope, or its name
    name: Name | None = None
    source: Name | None = None  # `measured` for a log of a real endoscope
    signal: Name | None = None
    twin: Name | None = None  # kind of the twin
    seed: Whole | None = None
    episode: Whole | None = None  # its number within the seed
    samples: Whole | None = None
    stroke_mm: Pair | None = None  # lowest and highest pulling distance
    sheath_bend_deg: Pair | Number | None = None  # at the start and at the end, or throughout
    recipe_sha256: Name | None = None
    statistics: Annotated[dict[str, Statistics], Field(max_length=100)] | None = None
    pulley_radius: Positive | None = None  # [m] converts angles of a measured drive to pulling distances
    seconds_per_cycle: Positive | None = None  # of a log of phases
    file: Text | None = None  # that a measured log was read from
    file_sha256: Name | None = None
    window: Number | None = None  # number of a window in the file that it was cut from
    endotwin: Name | None = None  # version that wrote the record
    mujoco: Name | None = None  # version that simulated it


def check_facts(metadata: Mapping[str, Any]) -> None:
    """Refuse metadata whose known keys are not of their kind; the error names key, value and rule."""
    if len(metadata) > MOST_ITEMS:
        raise InputError(f"metadata has {len(metadata)} items: at most {MOST_ITEMS}")
    try:
        preset = validated(EpisodeFacts, metadata).preset
    except ValueError as error:
        raise InputError(f"metadata {error}") from None
    if isinstance(preset, Mapping):
        try:
            validated(PresetFacts, preset)
        except ValueError as error:
            raise InputError(f"metadata preset: {error}") from None
    elif preset is not None:
        check_name("metadata preset", preset)
