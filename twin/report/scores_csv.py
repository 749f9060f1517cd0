"""The scores of a comparison as a CSV table, for those who compare theirs by other tools."""

from collections.abc import Sequence

from twin.evaluation.score import Score
from twin.report.csv_table import csv_table

COLUMNS = (
    "method",
    "oracle",
    "noise",
    "level",
    "sample_time_s",
    "stroke_low_mm",
    "stroke_high_mm",
    "twin",
    "rmse_deg",
    "rmse_low_deg",
    "rmse_high_deg",
    "rmse_steady_deg",
    "times_best_low",
    "times_best_high",
    "coverage95",
    "width95_deg",
    "crps_deg",
    "seeds",
    "trainings",
)
"""Names of the columns: of the paired interval to the best method, `times_best_low` and `times_best_high`."""


def scores_csv(scores: Sequence[Score]) -> str:
    """Return the scores, a line each; what is not known is left empty."""
    return csv_table(COLUMNS, map(_row, scores))


def _row(score: Score) -> tuple[object, ...]:
    stroke = score.stroke_mm if len(score.stroke_mm) == 2 else (None, None)
    return (
        score.method,
        str(score.oracle).lower(),
        score.noise,
        score.level,
        score.sample_time_s,
        *stroke,
        score.twin,
        score.rmse_deg,
        *score.rmse_ci95_deg,
        score.rmse_steady_deg,
        *(score.to_best_ci95 or (None, None)),
        score.coverage95,
        score.width95_deg,
        score.crps_deg,
        score.seeds,
        score.trainings,
    )
