"""Table and figure of an ablation: what each part of a method is worth."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import Condition
from twin.report.figures import INK, MUTED, clean_axes
from twin.report.tables import aligned_table, in_brackets, twin_name

COLOUR = "#a3195b"
SHOWN = (("gaussian", 1.0), ("poisson", 2.0), ("gamma", 1.0), ("salt-and-pepper", 0.05))
"""Noises that have a column of their own: a symmetric one, skewed ones, outliers."""
_TICKS = (0.5, 0.7, 0.8, 0.9, 1, 1.1, 1.2, 1.3, 1.5, 1.7, 2, 3, 5, 7, 10)


@dataclasses.dataclass(frozen=True)
class AblationRow:
    """Variant of a method and what it reaches; errors are geometric means of the RMSE.

    Attributes:
        name: of the variant.
        change: what differs from the whole, in words.
        by_twin_deg: by kind of twin, over noises and strokes [deg].
        by_noise_deg: by noise, over kinds of twins and strokes [deg].
        times_whole: over all of them, in units of the whole.
        times_whole_ci95: paired 95 % interval of that; None where nothing can be drawn anew.
        coverage95: share of samples whose interval holds the truth; None where none is stated.
        trainings: how many it is the mean over.
    """

    name: str
    change: str
    by_twin_deg: dict[str, float]
    by_noise_deg: dict[Condition, float]
    times_whole: float
    times_whole_ci95: tuple[float, float] | None
    coverage95: float | None
    trainings: int

    def to_dict(self) -> dict[str, Any]:
        """Return the row as JSON holds it."""
        noises = [
            {"noise": kind, "level": level, "rmse_deg": error}
            for (kind, level), error in self.by_noise_deg.items()
        ]
        return dataclasses.asdict(self) | {"by_noise_deg": noises}


def ablation_table(rows: Sequence[AblationRow]) -> str:
    """Return the variants as a table in Markdown, in the order that they are given in."""
    twins = list(rows[0].by_twin_deg)
    noises = [noise for noise in SHOWN if noise in rows[0].by_noise_deg]
    lines = [
        [
            row.change,
            *(f"{row.by_twin_deg[twin]:.2f}" for twin in twins),
            *(f"{row.by_noise_deg[noise]:.2f}" for noise in noises),
            f"{row.times_whole:.2f}" + in_brackets(row.times_whole_ci95, ".2f"),
            "-" if row.coverage95 is None else f"{100 * row.coverage95:.0f}",
            str(row.trainings),
        ]
        for row in rows
    ]
    headers = [
        "what is changed",
        *map(twin_name, twins),
        *(noise_label(*noise) for noise in noises),
        "times the whole",
        "coverage [%]",
        "trainings",
    ]
    return aligned_table(lines, headers)


def ablation_figure(rows: Sequence[AblationRow]) -> Figure:
    """Draw each variant's error in units of the whole's, with its paired 95 % interval."""
    figure = Figure(figsize=(6.4, 0.26 * len(rows) + 0.9), layout="constrained")
    axes = figure.subplots()
    clean_axes(axes)
    axes.axvline(1.0, color=MUTED, linewidth=0.8)
    for line, row in enumerate(reversed(rows)):
        if row.times_whole_ci95 is not None:
            axes.plot(row.times_whole_ci95, [line, line], color=COLOUR, linewidth=1.4)
        axes.plot(row.times_whole, line, "o", markersize=4.5, color=COLOUR)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_major_locator(FixedLocator(_TICKS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_yticks(range(len(rows)), [row.change for row in reversed(rows)], fontsize=8, color=INK)
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.tick_params(labelsize=8)
    axes.set_xlabel("RMSE over that of the whole, paired 95 % interval", fontsize=8, color=INK)
    return figure
