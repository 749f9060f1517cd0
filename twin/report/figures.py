"""Figures of results: loops, tracking, training and errors; one message each, readable in greyscale.

A method keeps its colour and line in all of them, and is named next to what it drew. No figure touches
pyplot or its global state.
"""

import io
import itertools
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, PercentFormatter
from numpy.typing import NDArray

from twin.episode import Episode, Record
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
TRUTH = Style("#000000", (0, (4, 2)), 1.2)
COLUMN, PAGE = 3.5, 7.2  # widths of a column of a paper, and of its page [inches]
START_SECONDS = 8.0
"""Length of the close-up of the start of a tracking figure, where the wrong initial estimate decays [s]."""
PAPER_FIGURES = {5: ("gaussian", 1.0), 6: ("gaussian", 1.0), 7: ("gaussian", 5.0)}
PAPER_FIGURES |= {8: ("poisson", 0.1), 9: ("poisson", 1.0), 10: ("poisson", 2.0)}
"""Noise and level by number in the paper; a method declares in which it is shown."""
_GREYS = ("#30363d", "#868f99", "#52606d", "#a2703f", "#3b6d6d")
_OTHER = tuple(Style(colour, (0, (2, 1))) for colour in _GREYS)
MOST_COLUMNS = {COLUMN: 3, PAGE: 6}  # noises side by side, by the width of the figure
SMALL = 7.0  # letters of figures for papers [points]
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


class NotebookFigure(Figure):
    """Figure that a notebook shows as the last line of a cell, without pyplot."""

    def _repr_png_(self) -> bytes:
        return to_png_bytes(self, dpi=100)


def episode_figure(episode: Episode) -> NotebookFigure:
    """Draw the loop of an episode, and its bending angle and pull over time; dots are measurements."""
    record = episode.record()
    figure = NotebookFigure(figsize=(8.6, 4.2), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.3), height_ratios=(1.4, 1))
    loop, bend = (clean_axes(figure.add_subplot(place)) for place in (grid[:, 0], grid[0, 1]))
    pull = clean_axes(figure.add_subplot(grid[1, 1], sharex=bend))
    for axes, x in ((loop, record.pull_mm), (bend, record.time)):
        axes.plot(x, record.measured_deg, linestyle="", label="measured", **MEASUREMENT)
        if not record.is_measured:
            axes.plot(x, record.truth_deg, color=INK, linewidth=1.2, label="true")
        axes.set_ylabel("bending angle [deg]")
    pull.plot(record.time, record.pull_mm, color=INK, linewidth=1.2)
    pull.set(xlabel="time [s]", ylabel="pull [mm]")
    loop.set_xlabel("pulling distance [mm]")
    figure.align_ylabels([bend, pull])
    handles, _ = loop.get_legend_handles_labels()
    figure.legend(handles=handles, loc="outside lower left", ncols=2, frameon=False, fontsize=8.5)
    origin = repr(episode).partition("\n")[0]
    figure.suptitle(origin, x=0.01, ha="left", fontsize=10, color=INK, parse_math=False)
    return figure


def tracking_figure(
    track: Record,
    methods: Sequence[str],
    title: str,
    notes: Mapping[str, str] | None = None,
    width: float = PAGE,
) -> Figure:
    """Draw truth and estimates over their errors (the paper's Figs. 5-10), `notes` next to the methods.

    A figure over the page shows the first seconds too.
    """
    errors = {method: track.error_deg(method) for method in methods}
    lines = {method: line_of(style_of(method, methods)) for method in methods}
    columns = 2 if width > COLUMN else 1
    figure = Figure(figsize=(width, 3.6 if columns == 2 else 3.0), layout="constrained")
    ratios: dict[str, Any] = {"width_ratios": (1.5, 1)[:columns], "height_ratios": (1.25, 1)}
    grid = figure.subplots(2, columns, sharex="col", squeeze=False, **ratios)
    for upper, lower in grid.T:
        clean_axes(upper, SMALL).plot(track.time, track.measured_deg, linestyle="", **MEASUREMENT)
        for method, line in lines.items():
            upper.plot(track.time, track.estimates[method], **line)
            clean_axes(lower, SMALL).plot(track.time, errors[method], **line)
        upper.plot(track.time, track.truth_deg, **line_of(TRUTH))
        lower.axhline(0, color=TRUTH.colour, linewidth=0.6)
        lower.set_xlabel("time [s]")
    start = track.time[0]
    ends = [track.time[-1], min(start + START_SECONDS, track.time[-1])]
    for upper, end in zip(grid[0], ends, strict=False):
        upper.set_xlim(start, end)
    if columns == 2:
        grid[0, 1].set_title(f"the first {START_SECONDS:g} s", fontsize=SMALL, color=MUTED, loc="left")
    later = track.time >= start + START_SECONDS / 2
    if later.any():
        bound = max(1.15 * max(float(np.abs(error[later]).max()) for error in errors.values()), 0.1)
        grid[1, 0].set_ylim(-bound, bound)
    grid[0, 0].set_ylabel("bending angle [deg]")
    grid[1, 0].set_ylabel("error [deg]")
    figure.align_ylabels(grid[:, 0])
    grid[0, 0].set_title(title, fontsize=SMALL + 1, color=INK, loc="left", fontweight="bold")
    end, stated = ends[columns - 1], notes or {}
    angles = {
        "measurement": (track.measured_deg, MEASUREMENT),
        "true angle": (track.truth_deg, line_of(TRUTH)),
    }
    label_ends(
        grid[0, -1], {name: (end, _last(track.time, of, end), line) for name, (of, line) in angles.items()}
    )
    named = {method: f"{method}  {stated.get(method, '')}".rstrip() for method in methods}
    label_ends(
        grid[1, -1],
        {named[method]: (end, _last(track.time, errors[method], end), lines[method]) for method in methods},
        "RMSE [deg] (paper)"
        if any("(" in note for note in stated.values())
        else "RMSE [deg]"
        if stated
        else "",
    )
    return figure


def _last(time: Array, values: Array, end: float) -> float:
    """Return the last finite value (N,) up to a time; zero without any."""
    known = values[(time <= end) & np.isfinite(values)]
    return float(known[-1]) if len(known) else 0.0


def label_ends(
    axes: Axes, lines: Mapping[str, tuple[float, float, Mapping[str, Any]]], head: str = ""
) -> None:
    """Name lines where they end on axes whose limits are set, without overlap, under a heading.

    `lines` are the end of each, as x, y and its style, by the text.
    """
    box, dots = axes.get_window_extent(), axes.figure.dpi
    step, gap = 1.3 * SMALL / 72 * dots / box.height, 0.16 * dots / box.width
    axes.get_xlim(), axes.get_ylim()  # those of the data from here on
    to_axes = axes.transData + axes.transAxes.inverted()
    ends = {text: np.clip(to_axes.transform((x, y)), 0, 1) for text, (x, y, _) in lines.items()}
    places = {text: float(y) for text, (_, y) in ends.items()}
    for at in {float(x) for x, _ in ends.values()}:
        rising = sorted((text for text in lines if ends[text][0] == at), key=places.__getitem__)
        for below, text in itertools.pairwise(rising):
            places[text] = max(places[text], places[below] + step)
        top = 1.0 - step * bool(head)
        for text in reversed(rising):
            places[text] = top = min(places[text], top)
            top -= step
    write: dict[str, Any] = {"fontsize": SMALL, "va": "center", "annotation_clip": False}
    write |= {"xycoords": "axes fraction", "textcoords": "axes fraction"}
    for text, (_, _, style) in lines.items():
        arrow = {"arrowstyle": "-", "relpos": (0, 0.5), "shrinkA": 1, "shrinkB": 0, "color": style["color"]}
        arrow |= {name: style[name] for name in ("linestyle", "linewidth") if name in style}
        place = float(ends[text][0]) + gap, places[text]
        axes.annotate(text, tuple(ends[text]), place, color=INK, arrowprops=arrow, **write)
    if head:
        place = 1 + gap, max(places.values()) + step
        axes.annotate(head, place, color=MUTED, **write)


def paper_figures(
    tracks: Mapping[Condition, Record], scores: Sequence[Score] = (), width: float = PAGE
) -> dict[int, tuple[Figure, str]]:
    """Return the paper's Figs. 5 to 10 with captions, by number, and with the best deployable method.

    Those that the tracks lack are left out.
    """
    by_method = {(*score.condition, score.method): score for score in tables.protocol_scores(scores)}
    figures, best = {}, tables.best_deployable(scores)
    for number, (noise, level) in PAPER_FIGURES.items():
        track = tracks.get((noise, level))
        shown = [spec for spec in method_specs() if number in spec.presentation.paper_figures]
        wanted = tables.ordered([*(spec.name for spec in shown), *([best] if shown and best else [])])
        methods = [method for method in wanted if track is not None and method in track.estimates]
        if track is None or not methods:
            continue
        notes = {}
        for method in methods:
            if score := by_method.get((noise, level, method)):
                published = score.paper_rmse_deg
                of_paper = "" if published is None else f" ({tables.paper_figure(published, 2)})"
                notes[method] = f"{score.rmse_deg:.2f}{of_paper}"
        label = noise_label(noise, level)
        caption = f"As the paper's Fig. {number}: {', '.join(methods)} under {label}."
        if notes:
            caption += " Next to the methods: RMSE over all test records and seeds; in brackets, the paper's."
        figures[number] = (tracking_figure(track, methods, label, notes, width), caption)
    return figures


def training_figure(curves: dict[str, dict[str, Array]]) -> Figure:
    """Draw the cost per step of each agent over its `samples` (M,), from the mean `return` (M,) [deg^2]."""
    figure = Figure(figsize=(5.6, 3.2), layout="constrained")
    axes = clean_axes(figure.subplots())
    agents, ends = tables.ordered(curves), {}
    for agent in agents:
        samples, cost = np.asarray(curves[agent]["samples"]), -np.asarray(curves[agent]["return"])
        style = style_of(agent, agents)
        if len(cost) == 1:  # a training that states no more than its end
            axes.plot(samples / 1e3, cost, "o", color=style.colour)
        axes.plot(samples / 1e3, cost, color=style.colour, linewidth=0.6, alpha=0.3)
        window = max(len(cost) // 25, 1)
        padded = np.concatenate([np.full(window - 1, cost[0]), cost])
        smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, window), axis=-1)
        axes.plot(samples / 1e3, smooth, color=style.colour, linestyle=style.line, linewidth=1.6)
        ends[agent] = samples[-1] / 1e3, smooth[-1], line_of(style)
    if all((np.asarray(curve["return"]) < 0).all() for curve in curves.values()):
        axes.set_yscale("log")
        log_ticks(axes.yaxis, [digit * 10.0**power for power in range(-6, 6) for digit in (1, 2, 5)])
    axes.set_xlabel("samples [thousands]")
    axes.set_ylabel("cost per step (negative reward) [deg²]")
    label_ends(axes, ends)
    return figure


def log_ticks(axis: Any, ticks: Sequence[float]) -> None:
    """Mark a logarithmic axis at these values alone, as plain numbers."""
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def to_svg(figure: Figure) -> str:
    """Return a figure as SVG text; the same figure gives the same text."""
    return to_bytes(figure, "svg").decode()


def to_png_bytes(figure: Figure, dpi: int = 200) -> bytes:
    """Return a figure as a PNG file of `dpi` pixels per inch."""
    return to_bytes(figure, "png", dpi)


def to_bytes(figure: Figure, kind: str, dpi: int = 200) -> bytes:
    """Return a figure as a file, `png`, `svg` or `pdf`, the same for the same figure; PDF embeds TrueType."""
    buffer, undated = io.BytesIO(), {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    made: dict[str, Any] = {"Software" if kind == "png" else "Creator": MADE_BY} | undated.get(kind, {})
    with matplotlib.rc_context({"svg.hashsalt": "endotwin", "pdf.fonttype": 42}):
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=made)
    return buffer.getvalue()


def clean_axes(axes: Axes, size: float = 8.5) -> Axes:
    """Give axes the look of all figures: a light grid, no frame at the top and the right.

    `size` is that of the letters at the ticks [points].
    """
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color="#b9c0c8", linewidth=0.8)
    axes.tick_params(colors=MUTED, labelsize=size, length=0)
    axes.xaxis.label.set(color=INK, fontsize=size + 1)
    axes.yaxis.label.set(color=INK, fontsize=size + 1)
    return axes


def comparison_figures(
    scores: Sequence[Score], tracks: Mapping[Condition, Record], rankings: Sequence[Ranking] = ()
) -> dict[str, Figure]:
    """Return the figures of a comparison by name: over the page, and `NAME_column` in a column of a paper.

    Tracks are of the first group of episodes at the longest sample time.
    """
    shown, ranked = tables.protocol_scores(scores), rankings_to_draw(rankings)
    figures = {}
    for width, end in ((PAGE, ""), (COLUMN, "_column")):
        of_noises = shown if width > COLUMN else tables.front_scores(scores)
        figures[f"rmse{end}"] = noise_figure(of_noises, width)
        if tables.has_limit(scores):
            figures[f"times_the_limit{end}"] = limit_figure(scores, width)
        if ranked:
            figures[f"ranks{end}"] = rank_figure(ranked, width)
        if tables.interval_scores(shown):
            figures[f"intervals{end}"] = interval_figure(shown, width)
        for number, (figure, _) in paper_figures(tracks, shown, width).items():
            figures[f"figure_{number:02d}{end}"] = figure
    return figures


def _colour(method: str) -> str:
    own = own_style(method)
    return INK if tables.is_limit(method) else MUTED if own is None else own.colour


def _list_methods(axes: Axes, methods: Sequence[str]) -> None:
    axes.set_yticks(range(len(methods)), methods, fontsize=SMALL)
    axes.tick_params(labelsize=SMALL, labelbottom=True)
    axes.set_ylim(-0.6, len(methods) - 0.4)


def noise_figure(scores: Sequence[Score], width: float = PAGE) -> Figure:
    """Draw the RMSE of every method on one group, a panel for each noise, the least mean error on top."""
    if not scores:
        raise InputError("no rows of evaluation.json: nothing to draw")
    noises = list(dict.fromkeys(score.condition for score in scores))
    methods = list(reversed(tables.mean_errors(scores)))
    lines = -(-len(noises) // MOST_COLUMNS[width])
    columns = -(-len(noises) // lines)
    size = width, (0.14 * len(methods) + 0.5) * lines + 0.35
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(lines, columns, sharey=True, sharex=True, squeeze=False).ravel()
    values = {(score.condition, score.label): score for score in scores}
    limits = {score.condition: score.rmse_deg for score in scores if tables.is_limit(score.method)}
    for axes, noise in zip(grid, noises, strict=False):
        clean_axes(axes, SMALL)
        if noise in limits:
            axes.axvline(limits[noise], color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
        for line, method in enumerate(methods):
            score = values.get((noise, method))
            if score is None:
                continue
            low, high = score.rmse_ci95_deg
            style: dict[str, Any] = {"color": _colour(score.method), "markersize": 3.6}
            axes.plot([max(low, 1e-3), high], [line, line], color=style["color"], linewidth=1.2)
            face = "white" if score.oracle else style["color"]
            axes.plot(score.rmse_deg, line, "o", markerfacecolor=face, **style)
            if score.paper_rmse_deg is not None:
                axes.plot(score.paper_rmse_deg, line, "x", markeredgewidth=1.2, **style)
        axes.set_xscale("log")
        axes.set_title(noise_label(*noise).replace(", ", "\n"), fontsize=SMALL, color=INK, loc="left")
        _list_methods(axes, methods)
    drawn = [of for score in scores for of in (score.rmse_deg, score.paper_rmse_deg) if of]
    low, high = 0.9 * 10 ** np.floor(np.log10(0.9 * min(drawn))), max(1.4 * max(drawn), 1.1)
    ticks = [0.1, 1, 10] if columns > 3 or width < PAGE else [0.1, 0.3, 1, 3, 10]
    log_ticks(grid[0].xaxis, [tick for tick in (0.001, 0.01, *ticks, 100, 1000) if low < tick < high])
    grid[0].set_xlim(low, high)
    for axes in grid[len(noises) :]:
        axes.set_visible(False)
    marks = {"hollow: oracle": any(score.oracle for score in scores), "dashed: the limit": limits}
    marks["cross: the paper, another endoscope"] = any(score.paper_rmse_deg for score in scores)
    shown = (mark for mark, there in marks.items() if there)
    _label_below(figure, "; ".join(["RMSE [deg], 95 % interval over seeds", *shown]))
    return figure


def limit_figure(scores: Sequence[Score], width: float = PAGE) -> Figure:
    """Draw the ratio of each method's RMSE to the limit, for every group of episodes and sample time.

    In a column of a paper, for the longest sample time alone.
    """
    times = sorted({score.sample_time_s for score in scores}, reverse=True)[: None if width > COLUMN else 1]
    groups = tables.groups_of(scores)
    methods = list(tables.times_the_limit(scores, times, groups))
    letters = min(SMALL, 27 * (width - 1.4) / (len(groups) * len(times)))  # a ratio has up to three
    figure = Figure(figsize=(width, 0.16 * len(methods) + 1.7), layout="constrained")
    panels = figure.subplots(1, len(times), sharey=True, squeeze=False)[0]
    for axes, T in zip(panels, times, strict=True):
        columns = [tables.times_the_limit(scores, [T], [group]) for group in groups]
        cells = np.array([[column.get(method, np.nan) for column in columns] for method in methods])
        axes.imshow(np.log(cells), cmap="Greys", vmin=0, vmax=np.log(40), aspect="auto")
        for (line, column), value in np.ndenumerate(cells):
            ink = "white" if np.log(value) > 0.55 * np.log(40) else INK
            text = f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
            axes.text(column, line, text, ha="center", va="center", fontsize=letters, color=ink)
        labels = [f"{twin} [{low:g}, {high:g}]" for (low, high), twin in groups]
        axes.set_xticks(range(len(groups)), labels, rotation=60, ha="right", fontsize=SMALL)
        axes.set_yticks(range(len(methods)), methods, fontsize=SMALL)
        axes.set_title(f"T = {T:g} s", fontsize=SMALL, color=INK, loc="left")
        axes.tick_params(length=0, colors=INK)
        axes.spines[:].set_visible(False)
    title = "RMSE over the limit's, geometric mean over noises"
    figure.suptitle(title, fontsize=SMALL + 1, color=INK, x=0.01, ha="left")
    return figure


def rankings_to_draw(rankings: Sequence[Ranking]) -> list[Ranking]:
    """Return the rankings of the longest sample time that are of more than one method."""
    longest = max((of.sample_time_s for of in rankings), default=0.0)
    return [of for of in rankings if of.sample_time_s == longest and len(of.ranked) > 1]


def rank_figure(rankings: Sequence[Ranking], width: float = PAGE) -> Figure:
    """Draw every method's error in units of that of the first, with its paired 95 % interval.

    A panel for each group of episodes; in a column of a paper, the first group alone.
    """
    rankings = rankings[: None if width > COLUMN else 1]
    columns = len(rankings) if len(rankings) <= _PANELS + 1 else _PANELS
    rows = -(-len(rankings) // columns)
    methods = [of.method for of in tables.by_error(rankings[0])][::-1]
    figure = Figure(figsize=(width, rows * (0.15 * len(methods) + 0.5) + 0.4), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, ranking in zip(grid, rankings, strict=False):
        clean_axes(axes, SMALL)
        axes.axvline(1.0, color=MUTED, linewidth=0.8)
        by_name = {of.method: of for of in ranking.ranked}
        first = min((of.rmse_deg for of in ranking.ranked if of.rank == 1), default=None)
        for line, method in enumerate(methods):
            of = by_name.get(method)
            if of is None or first is None:
                continue
            colour = MUTED if own_style(method) is None else _colour(method)
            if of.to_best_ci95 is not None:
                axes.plot(of.to_best_ci95, [line, line], color=colour, linewidth=1.2)
            shape = "o" if of.rank is not None else "D"
            face = colour if is_level(of) else "white"
            axes.plot(of.rmse_deg / first, line, shape, markersize=3.6, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        log_ticks(axes.xaxis, (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100))
        place = tables.group_name((ranking.stroke_mm, ranking.twin))
        axes.set_title(place, fontsize=SMALL, color=INK, loc="left")
        _list_methods(axes, methods)
    for axes in grid[len(rankings) :]:
        axes.set_visible(False)
    _label_below(
        figure,
        "RMSE in units of the first's, geometric mean over noises, paired 95 % interval; "
        "filled: no other is better beyond doubt; diamonds do not compete",
    )
    return figure


def _label_below(figure: Figure, label: str) -> None:
    """Write a label below all panels, on as many lines as the width of the figure needs."""
    lines = textwrap.fill(label, int(17 * figure.get_figwidth()))
    figure.supxlabel(lines, fontsize=SMALL, color=INK)


def is_level(of: MethodRank) -> bool:
    """Return whether a method competes, and no other is better beyond doubt."""
    return of.rank is not None and (of.rank_ci95 is None or of.rank_ci95[0] == 1)


def interval_figure(scores: Sequence[Score], width: float = PAGE) -> Figure:
    """Draw the coverage of each method's 95 % interval, a dot for each noise, and next to it the CRPS.

    In a column of a paper, the CRPS is below.
    """
    stated, shape = tables.interval_scores(scores), (1, 2) if width > COLUMN else (2, 1)
    methods = list(reversed(stated))
    size = width, (0.17 * len(methods) + 0.65) * shape[0]
    figure = Figure(figsize=size, layout="constrained")
    left, right = axes = figure.subplots(*shape, sharey=True).ravel()
    left.axvspan(*_HONEST, color=MUTED, alpha=0.25, linewidth=0)
    for line, method in enumerate(methods):
        of = stated[method]
        own = own_style(of[0].method)
        style = {"color": MUTED if own is None else own.colour, "markeredgewidth": 0}
        left.plot([score.coverage95 for score in of], [line] * len(of), "o", markersize=4, alpha=0.7, **style)
        right.plot([score.crps_deg for score in of], [line] * len(of), "o", markersize=3, alpha=0.4, **style)
        right.plot(tables.mean_of(of, "crps_deg"), line, "|", markersize=8, markeredgewidth=1.6, color=INK)
    for panel in axes:
        clean_axes(panel, SMALL)
        _list_methods(panel, methods)
    left.set_xlim(-0.02, 1.02)
    left.xaxis.set_major_formatter(PercentFormatter(1.0))
    left.set_xlabel("truth in the 95 % interval; grey: 93 to 97 %", fontsize=SMALL)
    right.set_xscale("log")
    log_ticks(right.xaxis, (0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30))
    right.set_xlabel("CRPS [deg]; line: geometric mean", fontsize=SMALL)
    return figure
