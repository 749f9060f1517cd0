"""Scores: the rows of `evaluation.json`, their reader, and means over them."""

import dataclasses
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from twin.errors import InputError, MissingFileError
from twin.evaluation.metrics import geometric_mean
from twin.files.bounded import MEBIBYTE
from twin.files.bounds import MOST_TRAININGS
from twin.files.json_text import key_name, read_json, rule_of, validated
from twin.files.shown import shown

MOST_BYTES = 32 * MEBIBYTE  # limit of a file of results, which the full suite stays far below
MOST_ROWS = 100_000
LONGEST_TEXT = 200
LARGEST = 1e12  # magnitude of a figure that no evaluation comes near, in any of the units

Group = tuple[tuple[float, ...], str]  # stroke [mm] and kind of twin
Text = Annotated[str, Field(max_length=LONGEST_TEXT, strict=True)]
Figure = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False, strict=True)]
Interval = tuple[Figure, Figure]
Kind = TypeVar("Kind", bound=Hashable)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Score:
    """Errors of one method under one noise, over the records of one stroke and kind of twin.

    Attributes:
        noise: kind of the measurement noise.
        level: its level [deg^2 or deg].
        sample_time_s: T [s].
        stroke_mm: lowest and highest pulling distance [mm].
        twin: kind of twin, `measured`, or the name of a preset.
        method: name in the tables.
        oracle: whether the method was shown the truth.
        given: what the method knows, words of `twin.estimation.registry.GIVEN`.
        mae_deg: mean absolute error [deg].
        rmse_deg: root mean square error [deg].
        md_deg: mean |e - mean e| [deg].
        md_printed_deg2: the same as the paper prints it [deg^2].
        var_deg2: variance of the error [deg^2].
        bias_deg: mean error [deg].
        rmse_steady_deg: RMSE without the first 5 s [deg].
        rmse_ci95_deg: 95 % interval of the mean RMSE over noise seeds and training runs [deg].
        seeds: draws of the noise that the figures are means over.
        training_rmse_deg: RMSE of each training run of the method, where there are several: the figures are
            means over them too [deg].
        paper_rmse_deg: RMSE that the paper published, if it has this row and the records are of its
            instrument [deg].
        coverage95: share of samples whose stated 95 % interval covers the truth; None without intervals.
        width95_deg: mean width of that interval [deg].
        nees: mean square error in units of the stated variance: 1 where the interval is honest.
        nis: mean square innovation after the first 5 s, in units of the variance that prediction and sensor
            state together; of the first draw.
        crps_deg: mean continuous ranked probability score of a normal distribution of that interval [deg].
        to_best_ci95: 95 % interval of its RMSE in units of that of the best method that competes, on the same
            records and draws; None where there was but one run.
        is_best: whether it is better than each other method that competes, beyond doubt: correct for all
            noises of its records together in 95 % of comparisons.
    """

    noise: Text
    level: Figure
    sample_time_s: Figure
    stroke_mm: Annotated[tuple[Figure, ...], Field(max_length=2)] = ()
    twin: Text = ""
    method: Text
    oracle: Annotated[bool, Field(strict=True)]
    given: Annotated[tuple[Text, ...], Field(max_length=20)] = ()
    mae_deg: Figure
    rmse_deg: Figure
    md_deg: Figure
    md_printed_deg2: Figure | None = None
    var_deg2: Figure
    bias_deg: Figure
    rmse_steady_deg: Figure
    rmse_ci95_deg: Interval
    seeds: Annotated[int, Field(gt=0, le=int(LARGEST), strict=True)]
    training_rmse_deg: Annotated[tuple[Figure, ...], Field(max_length=MOST_TRAININGS)] = ()
    paper_rmse_deg: Figure | None = None
    coverage95: Figure | None = None
    width95_deg: Figure | None = None
    nees: Figure | None = None
    nis: Figure | None = None
    crps_deg: Figure | None = None
    to_best_ci95: Interval | None = None
    is_best: Annotated[bool, Field(strict=True)] = False

    @property
    def condition(self) -> tuple[str, float]:
        """Kind and level of the noise."""
        return self.noise, self.level

    @property
    def trainings(self) -> int:
        """Number of training runs, or of ensembles, that the figures are means over."""
        return max(len(self.training_rmse_deg), 1)

    @property
    def group(self) -> Group:
        """Stroke [mm] and kind of twin."""
        return self.stroke_mm, self.twin

    @property
    def label(self) -> str:
        """Name of the method; one that saw the clean truth is labelled as an oracle."""
        labelled = self.oracle and "oracle" not in self.method.lower()
        return f"{self.method} (oracle)" if labelled else self.method

    def to_dict(self) -> dict[str, Any]:
        """Return the row as `evaluation.json` holds it."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in dataclasses.asdict(self).items()
        }

    @classmethod
    def from_dict(cls, row: Mapping[str, Any]) -> Self:
        """Return the score of a row; unknown keys are ignored, a wrong value raises `ValueError`."""
        try:
            return TypeAdapter(cls).validate_python(row)
        except ValidationError as error:
            fault = error.errors(include_url=False, include_context=False)[0]
            name = key_name(fault["loc"][:1])
            if fault["type"] == "missing" and len(fault["loc"]) == 1:
                raise InputError(f"a row has no {name}") from None
            raise InputError(f"{name} = {shown(fault['input'])}: {rule_of(fault['msg'])}") from None


class EvaluationFile(BaseModel):
    """The keys of `evaluation.json`; other versions may add some."""

    model_config = ConfigDict(frozen=True, strict=True)

    protocol: Annotated[dict[str, Any], Field(max_length=100)]  # how methods were compared
    # scores, each as `Score.to_dict` writes it
    rows: Annotated[list[dict[str, Any]], Field(max_length=MOST_ROWS)]


def read_evaluation(path: Path) -> tuple[list[Score], dict[str, Any]]:
    """Return the scores of an `evaluation.json`, and all that it holds."""
    try:
        contents = read_json(path, MOST_BYTES)
        file = validated(EvaluationFile, contents)
    except MissingFileError:
        raise
    except ValueError as error:
        reason = str(error).removeprefix(f"{path} ")
        raise InputError(f"{path} is not the results of an evaluation: {reason}") from error
    scores = []
    for number, row in enumerate(file.rows):
        try:
            scores.append(Score.from_dict(row))
        except ValueError as error:
            raise InputError(f"{path}: row {number}: {error}") from None
    return scores, contents


def rmse_by(scores: Sequence[Score], kind_of: Callable[[Score], Kind]) -> dict[Kind, float]:
    """Return the geometric mean of the RMSE [deg] of the scores of each kind, in the order of the kinds."""
    kinds: dict[Kind, list[float]] = {}
    for score in scores:
        kinds.setdefault(kind_of(score), []).append(score.rmse_deg)
    return {kind: float(geometric_mean(np.array(errors))) for kind, errors in kinds.items()}


def mean_coverage(scores: Sequence[Score]) -> float | None:
    """Return the mean share of samples whose 95 % interval covers the truth; None where none is stated."""
    held = [score.coverage95 for score in scores if score.coverage95 is not None]
    return float(np.mean(held)) if held else None
