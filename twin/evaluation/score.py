"""A score: one row of `evaluation.json`, and the one reader that validates such a file."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field

from twin.errors import InputError, MissingFileError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json, validated
from twin.files.shown import shown

MOST_BYTES = 32 * MEBIBYTE
"""Limit of a file of results, which the full suite stays far below."""
MOST_ROWS = 100_000
MOST_TRAININGS = 100
"""Trainings of one method that are compared as one row."""
LONGEST_TEXT = 200
LARGEST = 1e12
"""Magnitude of a figure that no evaluation comes near, in any of the units."""

Group = tuple[tuple[float, ...], str]
"""Stroke [mm] and kind of twin."""


class EvaluationFile(BaseModel):
    """The keys of `evaluation.json`; other versions may add some.

    Attributes:
        protocol: how methods were compared.
        rows: scores, each as `Score.to_dict` writes it.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    protocol: Annotated[dict[str, Any], Field(max_length=100)]
    rows: Annotated[list[dict[str, Any]], Field(max_length=MOST_ROWS)]


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
        mae_deg: mean absolute error [deg].
        rmse_deg: root mean square error [deg].
        md_deg: mean |e - mean e| [deg].
        md_printed_deg2: the same as the paper prints it [deg^2].
        var_deg2: variance of the error [deg^2].
        bias_deg: mean error [deg].
        rmse_steady_deg: RMSE without the first 5 s [deg].
        rmse_ci95_deg: 95 % interval of the mean RMSE over noise seeds and trainings [deg].
        seeds: draws of the noise that the figures are means over.
        training_rmse_deg: RMSE of each training of the method, where there are several: the figures are means
            over them too [deg].
        paper_rmse_deg: RMSE that the paper published, if it has this row and the records are of its
            instrument [deg].
        coverage95: share of samples whose stated 95 % interval held the truth; None where none is stated.
        width95_deg: mean width of that interval [deg].
        nees: mean square error in units of the stated variance: 1 where the interval is honest.
        nis: mean square innovation after the first 5 s, in units of the variance that prediction and sensor
            state together; of the first draw.
        crps_deg: mean continuous ranked probability score of the normal law of that interval [deg].
        to_best_ci95: 95 % interval of its RMSE in units of that of the best method that competes, on the same
            records and draws; None where there was but one run.
    """

    noise: str
    level: float
    sample_time_s: float
    stroke_mm: tuple[float, ...] = ()
    twin: str = ""
    method: str
    oracle: bool
    mae_deg: float
    rmse_deg: float
    md_deg: float
    md_printed_deg2: float | None = None
    var_deg2: float
    bias_deg: float
    rmse_steady_deg: float
    rmse_ci95_deg: tuple[float, float]
    seeds: int
    training_rmse_deg: tuple[float, ...] = ()
    paper_rmse_deg: float | None = None
    coverage95: float | None = None
    width95_deg: float | None = None
    nees: float | None = None
    nis: float | None = None
    crps_deg: float | None = None
    to_best_ci95: tuple[float, float] | None = None

    @property
    def condition(self) -> tuple[str, float]:
        """Kind and level of the noise."""
        return self.noise, self.level

    @property
    def trainings(self) -> int:
        """Number of trainings, or of ensembles, that the figures are means over."""
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
        return dataclasses.asdict(self) | {
            "stroke_mm": list(self.stroke_mm),
            "rmse_ci95_deg": list(self.rmse_ci95_deg),
            "training_rmse_deg": list(self.training_rmse_deg),
            "to_best_ci95": self.to_best_ci95 and list(self.to_best_ci95),
        }

    @classmethod
    def from_dict(cls, row: Mapping[str, Any]) -> Self:
        """Return the score of a row; keys that other versions add are passed over.

        Raises:
            ValueError: a key is missing, or a value is of the wrong kind.
        """
        values = {}
        for field in dataclasses.fields(cls):
            if field.name in row:
                values[field.name] = _read(field.name, row[field.name])
            elif field.default is dataclasses.MISSING:
                raise InputError(f"a row has no {field.name}")
        return cls(**values)


def read_scores(path: Path) -> tuple[list[Score], dict[str, Any]]:
    """Return the scores and the protocol of an `evaluation.json`.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no such file, or a row is damaged.
    """
    scores, contents = read_evaluation(path)
    return scores, contents["protocol"]


def read_evaluation(path: Path) -> tuple[list[Score], dict[str, Any]]:
    """Return the scores of an `evaluation.json`, and all that it holds.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no such file, or a row is damaged.
    """
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


def to_rows(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """Return the rows of `evaluation.json`."""
    return [score.to_dict() for score in scores]


_TEXTS = ("noise", "twin", "method")
_LENGTHS = {
    "stroke_mm": (0, 2),  # a row need not tell its stroke
    "rmse_ci95_deg": (2,),
    "training_rmse_deg": range(MOST_TRAININGS + 1),
    "to_best_ci95": (2,),
}
_MAY_BE_NONE = (
    "paper_rmse_deg",
    "md_printed_deg2",
    "coverage95",
    "width95_deg",
    "nees",
    "nis",
    "crps_deg",
    "to_best_ci95",
)


def _read(name: str, value: Any) -> Any:
    """One value of a row, of its kind."""
    if name in _TEXTS:
        if isinstance(value, str) and len(value) <= LONGEST_TEXT:
            return value
    elif name == "oracle":
        if isinstance(value, bool):
            return value
    elif name in _MAY_BE_NONE and value is None:
        return None
    elif name in _LENGTHS:
        if isinstance(value, list | tuple) and len(value) in _LENGTHS[name] and all(map(_is_number, value)):
            return tuple(map(float, value))
    elif name == "seeds":
        if isinstance(value, int) and not isinstance(value, bool) and 0 < value <= LARGEST:
            return value
    elif _is_number(value):
        return float(value)
    raise InputError(f"{name} = {shown(value)}: of the wrong kind")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST
