"""Ranks of a comparison: a table and a figure of how far methods are apart, and how surely."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from twin.evaluation.ranking import MethodRank, Ranking
from twin.report.figures import INK, MUTED, clean_axes, own_style
from twin.report.tables import aligned_table, group_name

_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
_PANELS = 3
"""Panels beside each other, as there are strokes; one more fits where there is one line of them."""


def rank_table(ranking: Ranking) -> str:
    """Return the methods of a group in Markdown, the first on top: error, rank, distance to it."""
    lines = [
        [
            of.method,
            f"{of.rmse_deg:.3f}" + in_brackets(of.rmse_ci95_deg, ".3f"),
            "-" if of.rank is None else f"{of.rank}" + in_brackets(of.rank_ci95, "d"),
            "-" if of.to_best_ci95 is None else f"{of.to_best_ci95[0]:.2f} to {of.to_best_ci95[1]:.2f}",
        ]
        for of in _by_error(ranking)
    ]
    headers = ["method", "RMSE [deg]", "rank", "times the first"]
    return aligned_table(lines, headers)


def rankings_to_draw(rankings: Sequence[Ranking]) -> list[Ranking]:
    """Return the rankings of the longest sample time; none where there is but one method."""
    longest = max((of.sample_time_s for of in rankings), default=0.0)
    return [of for of in rankings if of.sample_time_s == longest and len(of.ranked) > 1]


def rank_figure(rankings: Sequence[Ranking]) -> Figure:
    """Draw every method's error in units of that of the first, with its paired 95 % interval.

    A panel for each group; filled marks are of methods that are level with the first.

    Args:
        rankings: of one sample time.
    """
    columns = len(rankings) if len(rankings) <= _PANELS + 1 else _PANELS
    rows = -(-len(rankings) // columns)
    methods = [of.method for of in _by_error(rankings[0])][::-1]
    figure = Figure(
        figsize=(2.4 + 2.1 * columns, rows * (0.2 * len(methods) + 0.7) + 0.4), layout="constrained"
    )
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, ranking in zip(grid, rankings, strict=False):
        clean_axes(axes)
        axes.axvline(1.0, color=MUTED, linewidth=0.8)
        by_name = {of.method: of for of in ranking.ranked}
        first = min((of.rmse_deg for of in ranking.ranked if of.rank == 1), default=None)
        for line, method in enumerate(methods):
            of = by_name.get(method)
            if of is None or first is None:
                continue
            own = own_style(method)
            colour = MUTED if own is None else own.colour
            if of.to_best_ci95 is not None:
                axes.plot(of.to_best_ci95, [line, line], color=colour, linewidth=1.3)
            face = colour if is_level(of) else "white"
            shape = "o" if of.rank is not None else "D"
            axes.plot(of.rmse_deg / first, line, shape, markersize=4.2, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_major_locator(FixedLocator(_TICKS))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_ylim(-0.6, len(methods) - 0.4)
        axes.set_title(group_name((ranking.stroke_mm, ranking.twin)), fontsize=8.5, color=INK, loc="left")
        axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
        axes.tick_params(labelsize=7.5, labelbottom=True)
    for axes in grid[len(rankings) :]:
        axes.set_visible(False)
    figure.supxlabel(
        "RMSE in units of the first's, geometric mean over noises, paired 95 % interval; "
        "filled: level with the first; diamonds do not compete",
        fontsize=8,
        color=INK,
    )
    return figure


def is_level(of: MethodRank) -> bool:
    """Return whether a method competes, and is the first or level with it."""
    return of.rank is not None and (of.rank == 1 or of.to_best_ci95 is None or of.to_best_ci95[0] <= 1)


def _by_error(ranking: Ranking) -> list[MethodRank]:
    return sorted(ranking.ranked, key=lambda of: of.rmse_deg)


def in_brackets(interval: tuple[float, float] | None, form: str) -> str:
    """Return an interval in a format, behind its figure; empty where there is none."""
    return "" if interval is None else f" ({interval[0]:{form}} to {interval[1]:{form}})"
