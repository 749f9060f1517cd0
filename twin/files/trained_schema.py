"""Schemas of the description in a trained file."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

MOST_MEMBERS = 512  # twins inside of an estimator at most
MOST_NUMBERS = 4096  # of one array of reference steps

Positive = Annotated[float, Field(ge=0, le=1e9)]
Finite = Annotated[float, Field(ge=-1e9, le=1e9)]
Limits = Annotated[tuple[Finite, Finite], Field(strict=False)]
Diagonal = Annotated[list[Positive], Field(min_length=2, max_length=2)]
SampleTime = Annotated[float, Field(ge=1e-6, le=100)]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True)


class ActiveModelFile(_Strict):
    """Parameters of a filter; units as in `twin.estimation.active_model.ActiveModel`."""

    model: dict[str, Any]  # of hysteresis, by its name and parameters
    sample_time: SampleTime
    process_variance: Diagonal
    measurement_variance: Annotated[float, Field(gt=0, le=1e9)]
    initial_variance: Diagonal


class DeploymentFile(_Strict):
    """Companions of a trained estimator; units as in `twin.estimation.deployment.Deployment`."""

    fallback: dict[str, Any]
    pull_mm: Limits
    bend_deg: Limits
    pull_speed_mm_s: Positive
    bend_speed_deg_s: Positive


class SheathFile(_Strict):
    """Courses of the sheaths of members, one number of each; see `twin.reduced.members.MemberSet`."""

    other: Annotated[list[Finite], Field(min_length=2, max_length=MOST_MEMBERS)]
    period: Annotated[list[Annotated[float, Field(ge=1, le=1e9)]], Field(max_length=MOST_MEMBERS)]
    phase: Annotated[list[Annotated[float, Field(ge=0, le=1)]], Field(max_length=MOST_MEMBERS)]


class TwinsFile(_Strict):
    """Endoscope and ranges of the twins that an estimator was trained on, of all that its file contains."""

    preset: Annotated[dict[str, float | int | str], Field(max_length=200)]
    ranges: Annotated[dict[str, Limits], Field(max_length=200)]


class MembersFile(_Strict):
    """Twins inside of an estimator: common parameters, and the value of each member of every other one."""

    preset: Annotated[dict[str, float | int | str], Field(max_length=200)]
    drawn: Annotated[
        dict[str, Annotated[list[float | int], Field(min_length=2, max_length=MOST_MEMBERS)]],
        Field(min_length=1, max_length=200),
    ]
    sheath: SheathFile | None = None  # where any moves
    # turning points of the history of each, where it is unknown [mm]
    turns_mm: (
        Annotated[
            list[
                Annotated[list[Annotated[float, Field(ge=-1000, le=1000)]], Field(min_length=2, max_length=2)]
            ],
            Field(min_length=2, max_length=MOST_MEMBERS),
        ]
        | None
    ) = None


class TrainedDescription(_Strict):
    """Description in a trained file, as far as it is read; the rest is the configuration of the run."""

    agent: Annotated[str, Field(max_length=40)]
    hidden: Annotated[int, Field(ge=1, le=1024)] | None = None  # units of a recurrent layer
    parameters: Annotated[int, Field(ge=0, le=10**9)] | None = None  # that were learned


class TrackingFile(_Strict):
    """Description of a policy that tracks a bend, as far as it is read: T, speed of the command."""

    sample_time: SampleTime
    speed_mm_s: Annotated[float, Field(gt=0, le=1e6)]


class NumbersFile(_Strict):
    """One array of the reference: its shape, steps first, and its values in the order of C, None for NaN."""

    shape: Annotated[list[Annotated[int, Field(ge=1, le=MOST_NUMBERS)]], Field(min_length=1, max_length=4)]
    values: Annotated[list[float | None], Field(min_length=1, max_length=MOST_NUMBERS)]


class ReferenceFile(_Strict):
    """Reference steps: inputs and outputs of the trained network by name.

    States among the inputs are those that the step before returned, zeros in the first.
    """

    inputs: Annotated[dict[str, NumbersFile], Field(min_length=1, max_length=20)]
    outputs: Annotated[dict[str, NumbersFile], Field(min_length=1, max_length=20)]
