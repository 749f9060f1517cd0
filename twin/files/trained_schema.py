"""Schemas of what a trained file says of itself."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

LARGEST_HIDDEN = 1024
"""Units of a recurrent layer at most."""

MOST_MEMBERS = 512
"""Twins inside of an estimator at most."""

MOST_NUMBERS = 4096
"""Numbers of one array of reference steps at most."""

Variance = Annotated[float, Field(ge=0, le=1e9)]
Finite = Annotated[float, Field(ge=-1e9, le=1e9)]


class ActiveModelFile(BaseModel):
    """Parameters of the filter as a trained file holds them; see `ActiveModel`.

    Attributes:
        model: of hysteresis, by its name and parameters.
        sample_time: T [s].
        process_variance: diagonal of Q.
        measurement_variance: R [deg^2].
        initial_variance: diagonal of P at the first sample.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    model: dict[str, Any]
    sample_time: Annotated[float, Field(ge=1e-6, le=100)]
    process_variance: Annotated[list[Variance], Field(min_length=2, max_length=2)]
    measurement_variance: Annotated[float, Field(gt=0, le=1e9)]
    initial_variance: Annotated[list[Variance], Field(min_length=2, max_length=2)]


Limits = Annotated[tuple[Finite, Finite], Field(strict=False)]


class DeploymentFile(BaseModel):
    """Companions of a trained estimator in its deployment; see `twin.estimation.deployment.Deployment`.

    Attributes:
        fallback: parameters of the trusted filter.
        pull_mm: lowest and highest pulling distance [mm].
        bend_deg: lowest and highest angle [deg].
        pull_speed_mm_s: of the fastest command [mm / s].
        bend_speed_deg_s: of the fastest motion [deg / s].
    """

    model_config = ConfigDict(frozen=True, strict=True)

    fallback: dict[str, Any]
    pull_mm: Limits
    bend_deg: Limits
    pull_speed_mm_s: Annotated[float, Field(ge=0, le=1e9)]
    bend_speed_deg_s: Annotated[float, Field(ge=0, le=1e9)]


class SheathFile(BaseModel):
    """Courses of the sheaths of members; see `twin.reduced.members.MemberSet`.

    Attributes:
        other: bend at the other end of the course [rad].
        period: time there and back [s].
        phase: share of it that has gone at the start.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    other: Annotated[list[Finite], Field(min_length=2, max_length=MOST_MEMBERS)]
    period: Annotated[list[Annotated[float, Field(ge=1, le=1e9)]], Field(max_length=MOST_MEMBERS)]
    phase: Annotated[list[Annotated[float, Field(ge=0, le=1)]], Field(max_length=MOST_MEMBERS)]


class MembersFile(BaseModel):
    """Twins inside of an estimator, as a trained file holds them.

    Attributes:
        preset: parameters that all of them have.
        drawn: the value of each member, of every other parameter.
        sheath: how their sheaths move, where any does.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    preset: Annotated[dict[str, float | int | str], Field(max_length=200)]
    drawn: Annotated[
        dict[str, Annotated[list[float | int], Field(min_length=2, max_length=MOST_MEMBERS)]],
        Field(min_length=1, max_length=200),
    ]
    sheath: SheathFile | None = None


class TrainedDescription(BaseModel):
    """Description in a trained file, as far as it is read; the rest is the configuration of the run.

    Attributes:
        agent: word that it was trained under.
        hidden: units of the recurrent layer.
        parameters: how many numbers were learned.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    agent: Annotated[str, Field(max_length=40)]
    hidden: Annotated[int, Field(ge=1, le=LARGEST_HIDDEN)] | None = None
    parameters: Annotated[int, Field(ge=0, le=10**9)] | None = None


class TrackingFile(BaseModel):
    """Description of a policy that tracks a bend, as far as it is read.

    Attributes:
        sample_time: T [s].
        speed_mm_s: speed limit of the command [mm / s].
    """

    model_config = ConfigDict(frozen=True, strict=True)

    sample_time: Annotated[float, Field(ge=1e-6, le=100)]
    speed_mm_s: Annotated[float, Field(gt=0, le=1e6)]


class NumbersFile(BaseModel):
    """One array of the reference.

    Attributes:
        shape: of it, steps first.
        values: in the order of C; None stands for NaN.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    shape: Annotated[list[Annotated[int, Field(ge=1, le=MOST_NUMBERS)]], Field(min_length=1, max_length=4)]
    values: Annotated[list[float | None], Field(min_length=1, max_length=MOST_NUMBERS)]


class ReferenceFile(BaseModel):
    """Reference steps as a trained file holds them.

    Attributes:
        inputs: of each step, by name; states are those that the step before returned, zeros in the first.
        outputs: that the trained network returned, by name.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    inputs: Annotated[dict[str, NumbersFile], Field(min_length=1, max_length=20)]
    outputs: Annotated[dict[str, NumbersFile], Field(min_length=1, max_length=20)]
