"""Figures of results: loops, tracking, training and errors; one message each, readable in greyscale.

A method keeps its colour, line and marker in all of them. No figure touches pyplot or its global state.
"""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, PercentFormatter
from numpy.typing import NDArray

from twin.episode import Record
from twin.errors import InputError
from twin.estimation.methods import Style
from twin.estimation.registry import method_spec, method_specs
from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import Condition
from twin.evaluation.ranking import MethodRank, Ranking
from twin.evaluation.score import Score
from twin.files.atomic import MADE_BY
from twin.report import tables

Array = NDArray[np.float64]
INK, MUTED, GRID = "#1d232c", "#6b7480", "#e9ecf0"
MEASUREMENT: dict[str, Any] = {"marker": "o", "markersize": 2.2, "markeredgewidth": 0, "color": "#a4abb4"}
FIT_COLOUR, LOOP_COLOUR = "#6f3fa0", "#a9b1ba"
TRUTH = Style("#000000", (0, (4, 2)), "", 1.2)
START_SECONDS = 8.0
"""Length of the close-up of the start of a tracking figure, where the wrong initial estimate decays [s]."""
PAPER_FIGURES = {5: ("gaussian", 1.0), 6: ("gaussian", 1.0), 7: ("gaussian", 5.0)}
PAPER_FIGURES |= {8: ("poisson", 0.1), 9: ("poisson", 1.0), 10: ("poisson", 2.0)}
"""Noise and level by number in the paper; a method declares in which it is shown."""
_GREYS = {"#30363d": "X", "#868f99": "<", "#52606d": ">", "#a2703f": "h", "#3b6d6d": "*"}
_OTHER = tuple(Style(colour, (0, (2, 1)), marker) for colour, marker in _GREYS.items())
MOST_COLUMNS = 6  # noises side by side
_PANELS = 3  # groups side by side, as there are strokes; one more fits where there is one line of them
_HONEST = (0.93, 0.97)  # coverage of a 95 % interval that is as sure as it states


def style_of(method: str, methods: Sequence[str] = ()) -> Style:
    """Return the style of a method; one without its own takes a grey by its place among `methods`."""
    own = own_style(method)
    if own is not None:
        return own
    others = [name for name in methods if own_style(name) is None]
    return _OTHER[others.index(method) % len(_OTHER) if method in others else 0]


def own_style(method: str) -> Style | None:
    """Return the style that a method declares, if it does."""
    spec = method_spec(method)
    return None if spec is None else spec.presentation.style


def line_of(style: Style) -> dict[str, Any]:
    """Return colour, line style and width as matplotlib takes them."""
    return {"color": style.colour, "linestyle": style.line, "linewidth": style.width}


def loop_figure(loops: Sequence[tuple[Array, Array]], fits: Sequence[Array] = ()) -> Figure:
    """Draw loops (pull_mm (N,), bend_deg (N,)), and fits (N,) of Coleman-Hodgdon models [deg] over them."""
    if fits and len(fits) != len(loops):
        raise InputError(f"{len(fits)} fits for {len(loops)} loops: give one each, or none")
    figure = Figure(figsize=(4.6, 4.0), layout="constrained")
    axes = clean_axes(figure.subplots())
    for pull, bend in loops:
        axes.plot(pull, bend, color=LOOP_COLOUR, linewidth=1.6, solid_joinstyle="round")
    fit_line: dict[str, Any] = {"color": FIT_COLOUR, "linestyle": (0, (4, 1.5))}
    for (pull, _), fit in zip(loops, fits, strict=False):
        axes.plot(pull, fit, linewidth=1.0, **fit_line)
    handles = [Line2D([], [], color=LOOP_COLOUR, linewidth=1.6, label="twin")]
    if fits:
        handles.append(Line2D([], [], label="Coleman-Hodgdon fit", **fit_line))
    figure.legend(handles=handles, loc="outside upper left", ncols=2, frameon=False, fontsize=8.5)
    axes.set_xlabel("pulling distance [mm]")
    axes.set_ylabel("bending angle [deg]")
    return figure


def tracking_figure(
    track: Record, methods: Sequence[str], title: str, notes: Mapping[str, str] | None = None
) -> Figure:
    """Draw truth and estimates over their errors: the complete record, and its first seconds (Figs. 5-10)."""
    errors = {method: track.error_deg(method) for method in methods}
    lines = {method: line_of(style_of(method, methods)) for method in methods}
    figure = Figure(figsize=(8.6, 4.3), layout="constrained")
    grid = figure.subplots(2, 2, sharex="col", width_ratios=(1.75, 1), height_ratios=(1.25, 1))
    for upper, lower in grid.T:
        clean_axes(upper).plot(track.time, track.measured_deg, linestyle="", **MEASUREMENT)
        for method, line in lines.items():
            upper.plot(track.time, track.estimates[method], **line)
            clean_axes(lower).plot(track.time, errors[method], **line)
        upper.plot(track.time, track.truth_deg, **line_of(TRUTH))
        lower.axhline(0, color=TRUTH.colour, linewidth=0.6)
        lower.set_xlabel("time [s]")
    start = track.time[0]
    grid[0, 0].set_xlim(start, track.time[-1])
    grid[0, 1].set_xlim(start, min(start + START_SECONDS, track.time[-1]))
    grid[0, 1].set_title(f"the first {START_SECONDS:g} s", fontsize=8.5, color=MUTED, loc="left")
    later = track.time >= start + START_SECONDS / 2
    if later.any():
        bound = max(1.15 * max(float(np.abs(error[later]).max()) for error in errors.values()), 0.1)
        grid[1, 0].set_ylim(-bound, bound)
    grid[0, 0].set_ylabel("bending angle [deg]")
    grid[1, 0].set_ylabel("error [deg]")
    figure.align_ylabels(grid[:, 0])
    grid[0, 0].set_title(title, fontsize=10, color=INK, loc="left", fontweight="bold")
    handles = [
        Line2D([], [], linestyle="", label="measurement", **MEASUREMENT),
        Line2D([], [], label="ground truth", **line_of(TRUTH)),
    ]
    for method, line in lines.items():
        note = (notes or {}).get(method)
        handles.append(Line2D([], [], label=f"{method}: {note}" if note else method, **line))
    columns = (len(handles) + 1) // 2 if notes else len(handles)
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False, fontsize=8.5)
    return figure


def paper_figures(
    tracks: Mapping[Condition, Record], scores: Sequence[Score] = ()
) -> dict[int, tuple[Figure, str]]:
    """Return the paper's Figs. 5 to 10 with captions, by number; those that the tracks lack are left out."""
    by_method = {(*score.condition, score.method): score for score in tables.protocol_scores(scores)}
    figures = {}
    for number, (noise, level) in PAPER_FIGURES.items():
        track = tracks.get((noise, level))
        wanted = [spec.name for spec in method_specs() if number in spec.presentation.paper_figures]
        methods = [method for method in wanted if track is not None and method in track.estimates]
        if track is None or not methods:
            continue
        notes = {}
        for method in methods:
            if score := by_method.get((noise, level, method)):
                published = score.paper_rmse_deg
                of_paper = "" if published is None else f" (paper {published + 1e-9:.2f})"
                notes[method] = f"{score.rmse_deg:.2f}{of_paper}"
        label = noise_label(noise, level)
        caption = f"As the paper's Fig. {number}: {', '.join(methods)} under {label}."
        if notes:
            caption += " In the legend: RMSE over all test records and seeds [deg]."
        figures[number] = (tracking_figure(track, methods, label, notes), caption)
    return figures


def training_figure(curves: dict[str, dict[str, Array]]) -> Figure:
    """Draw the cost per step of each agent over its `samples` (M,), from the mean `return` (M,) [deg^2]."""
    figure = Figure(figsize=(5.6, 3.2), layout="constrained")
    axes = clean_axes(figure.subplots())
    agents = tables.ordered(curves)
    for agent in agents:
        samples, cost = np.asarray(curves[agent]["samples"]), -np.asarray(curves[agent]["return"])
        style = style_of(agent, agents)
        axes.plot(samples / 1e3, cost, color=style.colour, linewidth=0.6, alpha=0.3)
        window = max(len(cost) // 25, 1)
        padded = np.concatenate([np.full(window - 1, cost[0]), cost])
        smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, window), axis=-1)
        axes.plot(samples / 1e3, smooth, color=style.colour, linestyle=style.line, linewidth=1.6, label=agent)
    if all((np.asarray(curve["return"]) < 0).all() for curve in curves.values()):
        axes.set_yscale("log")
    axes.set_xlabel("samples [thousands]")
    axes.set_ylabel("cost per step (negative reward) [deg²]")
    axes.legend(frameon=False, fontsize=8.5)
    return figure


def rmse_figure(scores: Sequence[Score]) -> Figure:
    """Draw the RMSE of every method under every noise, with its 95 % interval; hollow marks are the paper's.

    Of an evaluation, the scores of the paper's protocol are drawn.
    """
    scores = tables.protocol_scores(scores)
    if not scores:
        raise InputError("no rows of evaluation.json: nothing to draw")
    noises = sorted({score.condition for score in scores})
    methods = tables.ordered(score.label for score in scores)
    styles = {method: style_of(method, methods) for method in methods}
    slot = 0.8 / len(methods)
    figure = Figure(figsize=(max(6.2, 1.45 * len(noises)), 3.7), layout="constrained")
    axes = clean_axes(figure.subplots())
    axes.grid(False, axis="x")
    for score in scores:
        style = styles[score.label]
        place = noises.index(score.condition) + slot * (methods.index(score.label) + 0.5) - 0.4
        low, high = score.rmse_ci95_deg
        axes.plot([place, place], [max(low, 1e-3), high], color=style.colour, linewidth=1.4)
        axes.plot(place, score.rmse_deg, style.marker, color=style.colour, markersize=5.5, zorder=3)
        if score.paper_rmse_deg is not None:
            hollow: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": style.colour}
            axes.plot(place - 0.38 * slot, score.paper_rmse_deg, style.marker, markersize=5.5, **hollow)
    for edge in range(1, len(noises)):
        axes.axvline(edge - 0.5, color=GRID, linewidth=1)
    axes.set_xlim(-0.5, len(noises) - 0.5)
    axes.set_xticks(range(len(noises)), [noise_label(*noise).replace(", ", "\n") for noise in noises])
    axes.set_yscale("log")
    log_ticks(axes.yaxis, (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50))
    axes.set_ylabel("RMSE [deg]")
    point: dict[str, Any] = {"linestyle": ""}
    handles = [
        Line2D([], [], marker=style.marker, color=style.colour, label=method, **point)
        for method, style in styles.items()
    ]
    if any(score.paper_rmse_deg is not None for score in scores):
        hollow = {"markerfacecolor": "white", "markeredgecolor": MUTED}
        handles.append(Line2D([], [], marker="o", label="hollow: the paper", **point, **hollow))
    # One row keeps the order of the slots; a narrow figure has no room for it.
    columns = len(handles) if figure.get_figwidth() > 1.2 * len(handles) else 5
    spacing: dict[str, Any] = {"handletextpad": 0.1, "columnspacing": 1.2}
    figure.legend(
        handles=handles, loc="outside upper center", ncols=columns, frameon=False, fontsize=8.5, **spacing
    )
    return figure


def log_ticks(axis: Any, ticks: Sequence[float]) -> None:
    """Mark a logarithmic axis at these values alone, as plain numbers."""
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def to_svg(figure: Figure) -> str:
    """Return a figure as SVG text; the same figure gives the same text."""
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "endotwin"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def to_png_bytes(figure: Figure, dpi: int = 200) -> bytes:
    """Return a figure as a PNG file of `dpi` pixels per inch, without the version of the library."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": MADE_BY})
    return buffer.getvalue()


def clean_axes(axes: Axes) -> Axes:
    """Give axes the look of all figures: a light grid, no frame at the top and the right."""
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color="#b9c0c8", linewidth=0.8)
    axes.tick_params(colors=MUTED, labelsize=8.5, length=0)
    axes.xaxis.label.set(color=INK, fontsize=9.5)
    axes.yaxis.label.set(color=INK, fontsize=9.5)
    return axes


def comparison_figures(
    scores: Sequence[Score], tracks: Mapping[Condition, Record], rankings: Sequence[Ranking] = ()
) -> dict[str, bytes]:
    """Return PNG files by name; tracks are of the first group of episodes at the longest sample time."""
    longest, first = max(score.sample_time_s for score in scores), tables.groups_of(scores)[0]
    shown, ranked = tables.chosen_scores(scores, longest, first), rankings_to_draw(rankings)
    figures = {"rmse_by_noise.png": noise_figure(shown)}
    if tables.has_limit(scores):
        figures["times_the_limit.png"] = limit_figure(scores)
    if ranked:
        figures["ranks.png"] = rank_figure(ranked)
    if tables.interval_scores(shown):
        figures["intervals.png"] = interval_figure(shown)
    for number, (figure, _) in paper_figures(tracks, shown).items():
        figures[f"figure_{number:02d}.png"] = figure
    return {name: to_png_bytes(figure) for name, figure in figures.items()}


def _colour(method: str) -> str:
    own = own_style(method)
    return INK if tables.is_limit(method) else MUTED if own is None else own.colour


def _list_methods(axes: Axes, methods: Sequence[str]) -> None:
    axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
    axes.tick_params(labelsize=7.5, labelbottom=True)
    axes.set_ylim(-0.6, len(methods) - 0.4)


def noise_figure(scores: Sequence[Score]) -> Figure:
    """Draw the RMSE of every method on one group, a panel for each noise, the best on top, and the limit."""
    noises = list(dict.fromkeys(score.condition for score in scores))
    ratios = tables.times_the_limit(scores, [scores[0].sample_time_s], [scores[0].group])
    methods = list(reversed(ratios or dict.fromkeys(score.method for score in scores)))
    lines = -(-len(noises) // MOST_COLUMNS)
    columns = -(-len(noises) // lines)
    figure = Figure(figsize=(12, 0.22 * len(methods) * lines + 1.4), layout="constrained")
    grid = figure.subplots(lines, columns, sharey=True, sharex=True, squeeze=False).ravel()
    values = {(score.condition, score.method): score for score in scores}
    limits = {score.condition: score.rmse_deg for score in scores if tables.is_limit(score.method)}
    for axes, noise in zip(grid, noises, strict=False):
        clean_axes(axes)
        if noise in limits:
            axes.axvline(limits[noise], color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
        for line, method in enumerate(methods):
            score, colour = values[noise, method], _colour(method)
            low, high = score.rmse_ci95_deg
            axes.plot([max(low, 1e-3), high], [line, line], color=colour, linewidth=1.4)
            face = "white" if score.oracle else colour
            axes.plot(score.rmse_deg, line, "o", markersize=4.2, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        log_ticks(axes.xaxis, (0.1, 0.3, 1, 3, 10))
        axes.set_title(noise_label(*noise), fontsize=7.5, color=INK, loc="left")
        _list_methods(axes, methods)
        axes.set_xlim(0.05, 30)
    for axes in grid[len(noises) :]:
        axes.set_visible(False)
    label = "RMSE [deg], 95 % interval over seeds; dashed: the limit; hollow: oracle"
    figure.supxlabel(label, fontsize=8.5, color=INK)
    return figure


def limit_figure(scores: Sequence[Score]) -> Figure:
    """Draw the ratio of each method's RMSE to the limit, for every group of episodes and sample time."""
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    groups = tables.groups_of(scores)
    methods = list(tables.times_the_limit(scores, times, groups))
    size = 3.2 + 0.62 * len(groups) * len(times), 0.27 * len(methods) + 1.9
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(1, len(times), sharey=True, squeeze=False)[0]
    for axes, T in zip(panels, times, strict=True):
        columns = [tables.times_the_limit(scores, [T], [group]) for group in groups]
        cells = np.array([[column.get(method, np.nan) for column in columns] for method in methods])
        axes.imshow(np.log(cells), cmap="Greys", vmin=0, vmax=np.log(40), aspect="auto")
        for (line, column), value in np.ndenumerate(cells):
            ink = "white" if np.log(value) > 0.55 * np.log(40) else INK
            text = f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
            axes.text(column, line, text, ha="center", va="center", fontsize=7, color=ink)
        labels = [f"{twin} [{low:g}, {high:g}]" for (low, high), twin in groups]
        axes.set_xticks(range(len(groups)), labels, rotation=60, ha="right", fontsize=7.5)
        axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
        axes.set_title(f"T = {T:g} s", fontsize=9, color=INK, loc="left")
        axes.tick_params(length=0, colors=INK)
        axes.spines[:].set_visible(False)
    title = "RMSE over the limit's, geometric mean over noises"
    figure.suptitle(title, fontsize=9.5, color=INK, x=0.01, ha="left")
    return figure


def rankings_to_draw(rankings: Sequence[Ranking]) -> list[Ranking]:
    """Return the rankings of the longest sample time that are of more than one method."""
    longest = max((of.sample_time_s for of in rankings), default=0.0)
    return [of for of in rankings if of.sample_time_s == longest and len(of.ranked) > 1]


def rank_figure(rankings: Sequence[Ranking]) -> Figure:
    """Draw every method's error in units of that of the first, with its paired 95 % interval."""
    columns = len(rankings) if len(rankings) <= _PANELS + 1 else _PANELS
    rows = -(-len(rankings) // columns)
    methods = [of.method for of in tables.by_error(rankings[0])][::-1]
    size = 2.4 + 2.1 * columns, rows * (0.2 * len(methods) + 0.7) + 0.4
    figure = Figure(figsize=size, layout="constrained")
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
            colour = MUTED if own_style(method) is None else _colour(method)
            if of.to_best_ci95 is not None:
                axes.plot(of.to_best_ci95, [line, line], color=colour, linewidth=1.3)
            shape = "o" if of.rank is not None else "D"
            face = colour if is_level(of) else "white"
            axes.plot(of.rmse_deg / first, line, shape, markersize=4.2, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        log_ticks(axes.xaxis, (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100))
        axes.set_title(
            tables.group_name((ranking.stroke_mm, ranking.twin)), fontsize=8.5, color=INK, loc="left"
        )
        _list_methods(axes, methods)
    for axes in grid[len(rankings) :]:
        axes.set_visible(False)
    label = (
        "RMSE in units of the first's, geometric mean over noises, paired 95 % interval; "
        "filled: level with the first; diamonds do not compete"
    )
    figure.supxlabel(label, fontsize=8, color=INK)
    return figure


def is_level(of: MethodRank) -> bool:
    """Return whether a method competes, and is the first or level with it."""
    return of.rank is not None and (of.rank == 1 or of.to_best_ci95 is None or of.to_best_ci95[0] <= 1)


def interval_figure(scores: Sequence[Score]) -> Figure:
    """Draw the coverage of each method's 95 % interval, a dot for each noise, and next to it the CRPS."""
    stated = tables.interval_scores(scores)
    methods = list(reversed(stated))
    figure = Figure(figsize=(8.5, 0.24 * len(methods) + 1.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    for axes in (left, right):
        clean_axes(axes)
        axes.tick_params(labelsize=7.5)
    left.axvspan(*_HONEST, color=MUTED, alpha=0.25, linewidth=0)
    for line, method in enumerate(methods):
        of = stated[method]
        own = own_style(of[0].method)
        style = {"color": MUTED if own is None else own.colour, "markeredgewidth": 0}
        left.plot([score.coverage95 for score in of], [line] * len(of), "o", markersize=4, alpha=0.7, **style)
        right.plot([score.crps_deg for score in of], [line] * len(of), "o", markersize=3, alpha=0.4, **style)
        right.plot(tables.mean_of(of, "crps_deg"), line, "|", markersize=9, markeredgewidth=1.6, color=INK)
    left.set_yticks(range(len(methods)), methods, fontsize=7.5)
    left.set_xlim(-0.02, 1.02)
    left.xaxis.set_major_formatter(PercentFormatter(1.0))
    left.set_xlabel("truth within the 95 % interval, each noise; grey: 93 to 97 %", fontsize=8.5, color=INK)
    right.set_xscale("log")
    right.xaxis.set_major_formatter("{x:g}")
    right.set_xlabel("CRPS [deg]; line: geometric mean", fontsize=8.5, color=INK)
    return figure
