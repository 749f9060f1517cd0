"""Tables of the sealed suite: all methods on all conditions, and on each kind of them."""

import dataclasses
from collections.abc import Mapping, Sequence

from twin.estimation.registry import method_spec
from twin.evaluation.score import Score
from twin.evaluation.sealed_scores import Sealed
from twin.report.tables import Row, aligned_table, percent


def sealed_rows(scores: Sequence[Score], summaries: Mapping[str, Sealed | None]) -> list[Row]:
    """Return a row of each method of the sealed suite, the least error first; unknown values are None.

    Methods that compete have a summary, by name, if there is a rival.
    """
    rows = []
    first = [score for score in scores if score.group == scores[0].group]
    for score in sorted(first, key=lambda of: of.rmse_deg):
        summary, spec = summaries.get(score.method), method_spec(score.method)
        of_rival = {} if summary is None else dataclasses.asdict(summary)
        low, high = of_rival.get("ratio_ci95", (None, None))
        rows.append(
            {"method": score.label, "knows": spec.knows if spec else ""}
            | {"rmse_deg": score.rmse_deg}
            | dict(zip(("rmse_low_deg", "rmse_high_deg"), score.rmse_ci95_deg, strict=True))
            | {"rmse_steady_deg": score.rmse_steady_deg}
            | {"rival": of_rival.get("rival"), "ratio": of_rival.get("ratio")}
            | {"ratio_low": low, "ratio_high": high}
            | {"worse": of_rival.get("worse"), "honest": of_rival.get("honest")}
            | {"coverage95": score.coverage95, "trainings": score.trainings}
            | {of.twin: of.rmse_deg for of in scores if of.method == score.method and of.group != score.group}
        )
    return rows


def sealed_tables(rows: Sequence[Row], counts: Mapping[str, int]) -> str:
    """Return the tables of `sealed_rows` in Markdown; `counts` are the conditions of each kind."""

    def ratio(row: Row) -> str:
        if row["rival"] is None:
            return "-"
        return f"{row['ratio']:.2f} ({row['ratio_low']:.2f} to {row['ratio_high']:.2f}) of {row['rival']}"

    lines = [
        [
            *(row["method"], row["knows"]),
            f"{row['rmse_deg']:.2f} ({row['rmse_low_deg']:.2f} to {row['rmse_high_deg']:.2f})",
            *(f"{row['rmse_steady_deg']:.2f}", ratio(row)),
            *(percent(row[name]) for name in ("worse", "honest", "coverage95")),
            str(row["trainings"]),
        ]
        for row in rows
    ]
    headers = ["method", "knows", "RMSE [deg]", "after 5 s [deg]", "times the best other", "worse [%]"]
    headers += ["honest [%]", "coverage [%]", "trainings"]
    of_kinds = [[row["method"], *(f"{row[kind]:.2f}" for kind in counts)] for row in rows]
    return "\n\n".join(
        [
            "RMSE: geometric mean over conditions, from the second sample on. Worse: conditions in which the "
            "best other method has a smaller error. Honest: conditions in which a stated 95 % interval "
            "covers 90 to 98 % of the samples. Intervals: 95 %, over conditions and trainings.",
            aligned_table(lines, headers, left=2),
            "RMSE [deg] on each kind of condition (and how many there are):",
            aligned_table(of_kinds, ["method", *(f"{kind} ({count})" for kind, count in counts.items())]),
        ]
    )
