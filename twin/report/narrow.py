"""Figures of results for a narrow screen: the same messages in one column, in letters of full size."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

from twin.evaluation.paper import noise_label
from twin.evaluation.score import Score
from twin.evaluation.track import Track
from twin.report.figures import GRID, INK, MEASUREMENT, MUTED, TRUTH, clean_axes, style_of
from twin.report.tables import ordered, protocol_scores

WIDTH = 3.9
"""Width of the figures [inches]: that of a telephone's screen."""


def narrow_tracking_figure(
    track: Track, methods: Sequence[str], title: str, notes: Mapping[str, str] | None = None
) -> Figure:
    """Draw truth and estimates over their errors; arguments as in `twin.report.figures.tracking_figure`."""
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1))
    clean_axes(upper).plot(track.time, track.measurement_deg, linestyle="", **MEASUREMENT)
    clean_axes(lower).axhline(0, color=INK, linewidth=0.6)
    errors = {method: track.error_deg(method) for method in methods}
    handles = [
        Line2D([], [], linestyle="", label="measurement", **MEASUREMENT),
        Line2D([], [], color=TRUTH.colour, linestyle=TRUTH.line, label="ground truth"),
    ]
    for method in methods:
        style = style_of(method, methods)
        line: dict[str, Any] = {"color": style.colour, "linestyle": style.line, "linewidth": style.width}
        upper.plot(track.time, track.estimates[method], **line)
        lower.plot(track.time, errors[method], **line)
        note = (notes or {}).get(method, "")
        handles.append(Line2D([], [], label=f"{method}: {note}" if note else method, **line))
    upper.plot(track.time, track.truth_deg, color=TRUTH.colour, linestyle=TRUTH.line, linewidth=TRUTH.width)
    later = track.time >= track.time[0] + 4.0
    if later.any():
        bound = max(1.15 * max(float(np.abs(error[later]).max()) for error in errors.values()), 0.1)
        lower.set_ylim(-bound, bound)
    lower.set_xlim(track.time[0], track.time[-1])
    lower.set_xlabel("time [s]")
    upper.set_ylabel("bending angle [deg]")
    lower.set_ylabel("error [deg]")
    upper.set_title(title, fontsize=10, color=INK, loc="left", fontweight="bold")
    figure.align_ylabels([upper, lower])
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False, fontsize=8.5)
    return figure


def narrow_rmse_figure(scores: Sequence[Score]) -> Figure:
    """Draw the RMSE of every method, noise below noise; as in `twin.report.figures.rmse_figure`."""
    scores = protocol_scores(scores)
    noises = sorted({score.condition for score in scores})
    methods = ordered(score.label for score in scores)
    step = 1 / (len(methods) + 1)
    tall = 0.105 * (len(methods) + 1) * len(noises) + 0.22 * (len(methods) / 2 + 1) + 0.5
    figure = Figure(figsize=(WIDTH, tall), layout="constrained")
    axes = clean_axes(figure.subplots())
    axes.grid(visible=False, axis="y")
    for score in scores:
        style = style_of(score.label, methods)
        place = noises.index(score.condition) + step * (methods.index(score.label) + 1)
        low, high = score.rmse_ci95_deg
        axes.plot([max(low, 1e-3), high], [place, place], color=style.colour, linewidth=1.4)
        axes.plot(score.rmse_deg, place, style.marker, color=style.colour, markersize=5)
        if score.paper_rmse_deg is not None:
            hollow: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": style.colour}
            axes.plot(score.paper_rmse_deg, place, style.marker, markersize=5, **hollow)
    for edge in range(1, len(noises)):
        axes.axhline(edge, color=GRID, linewidth=1)
    axes.set_ylim(len(noises), 0)
    labels = [noise_label(*noise).replace(", ", "\n") for noise in noises]
    axes.set_yticks(np.arange(len(noises)) + 0.5, labels)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator([0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50]))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("RMSE [deg]")
    handles = []
    for method in methods:
        style = style_of(method, methods)
        handles.append(Line2D([], [], linestyle="", marker=style.marker, color=style.colour, label=method))
    if any(score.paper_rmse_deg is not None for score in scores):
        paper: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": MUTED}
        handles.append(Line2D([], [], linestyle="", marker="o", label="hollow: the paper", **paper))
    spaced: dict[str, Any] = {"handletextpad": 0.1, "columnspacing": 0.8}
    figure.legend(handles=handles, loc="outside upper left", ncols=2, frameon=False, fontsize=8, **spaced)
    return figure
