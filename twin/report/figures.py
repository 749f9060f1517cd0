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
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from twin.episode import Record
from twin.errors import InputError
from twin.estimation.methods import Style
from twin.estimation.registry import method_spec, method_specs
from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import Condition
from twin.evaluation.score import Score
from twin.files.atomic import MADE_BY
from twin.report.tables import ordered, protocol_scores

Array = NDArray[np.float64]

INK, MUTED, GRID = "#1d232c", "#6b7480", "#e9ecf0"
MEASUREMENT: dict[str, Any] = {"marker": "o", "markersize": 2.2, "markeredgewidth": 0, "color": "#a4abb4"}
FIT_COLOUR, LOOP_COLOUR = "#6f3fa0", "#a9b1ba"
TRUTH = Style("#000000", (0, (4, 2)), "", 1.2)
START_SECONDS = 8.0
"""Length of the close-up of the start of a tracking figure, where the wrong initial estimate decays [s]."""
PAPER_FIGURES = (
    (5, "gaussian", 1.0),
    (6, "gaussian", 1.0),
    (7, "gaussian", 5.0),
    (8, "poisson", 0.1),
    (9, "poisson", 1.0),
    (10, "poisson", 2.0),
)
"""Number in the paper, noise and level; a method declares in which it is shown."""
_OTHER = tuple(
    Style(colour, (0, (2, 1)), marker)
    for colour, marker in (
        ("#30363d", "X"),
        ("#868f99", "<"),
        ("#52606d", ">"),
        ("#a2703f", "h"),
        ("#3b6d6d", "*"),
    )
)


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
    """Draw loops and the Coleman-Hodgdon fit over them.

    Args:
        loops: (pull_mm (N,), bend_deg (N,)) of each episode.
        fits: (N,) response of the model [deg] to each pull; empty for loops alone.
    """
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
    """Draw truth and estimates over their errors: the complete record, and its first seconds (Figs. 5-10).

    Args:
        track: estimates along one record.
        methods: which of them to draw, the most important last (on top).
        title: of the figure.
        notes: follow the names of methods in the legend.
    """
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
    """Return the paper's Figs. 5 to 10 with captions, by number; those that the tracks lack are left out.

    Args:
        tracks: one for each noise, from `evaluate`.
        scores: of the episodes that the tracks are from; their RMSE and the published one go into the legend.
    """
    by_method = {(*score.condition, score.method): score for score in protocol_scores(scores)}
    figures = {}
    for number, noise, level in PAPER_FIGURES:
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
    """Draw the cost that each agent pays per step over the samples it has learned from; lower is better.

    Args:
        curves: by agent, `samples` (M,) and `return` (M,), the mean reward per step, negative [deg^2].
    """
    figure = Figure(figsize=(5.6, 3.2), layout="constrained")
    axes = clean_axes(figure.subplots())
    agents = ordered(curves)
    for agent in agents:
        samples, cost = np.asarray(curves[agent]["samples"]), -np.asarray(curves[agent]["return"])
        style = style_of(agent, agents)
        axes.plot(samples / 1e3, cost, color=style.colour, linewidth=0.6, alpha=0.3)
        smooth = _running_median(cost, max(len(cost) // 25, 1))
        axes.plot(samples / 1e3, smooth, color=style.colour, linestyle=style.line, linewidth=1.6, label=agent)
    if all((np.asarray(curve["return"]) < 0).all() for curve in curves.values()):
        axes.set_yscale("log")
    axes.set_xlabel("samples [thousands]")
    axes.set_ylabel("cost per step (negative reward) [deg²]")
    axes.legend(frameon=False, fontsize=8.5)
    return figure


def _running_median(values: Array, window: int) -> Array:
    """Median of the last `window` values at each place (M,)."""
    padded = np.concatenate([np.full(window - 1, values[0]), values])
    median: Array = np.median(np.lib.stride_tricks.sliding_window_view(padded, window), axis=-1)
    return median


def rmse_figure(scores: Sequence[Score]) -> Figure:
    """Draw the RMSE of every method under every noise, with its 95 % interval; hollow marks are the paper's.

    Of an evaluation, the scores of the paper's protocol are drawn.
    """
    scores = protocol_scores(scores)
    if not scores:
        raise InputError("no rows of evaluation.json: nothing to draw")
    noises = sorted({score.condition for score in scores})
    methods = ordered(score.label for score in scores)
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
