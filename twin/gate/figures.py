"""Figures of the gate's page: paired differences, coverage, faults, and the twin beside the logs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from twin.gate.result import Check
from twin.report.figures import INK, MUTED, clean_axes

GOOD, BAD, LINE = "#2f5d8a", "#b3261e", "#a9b1ba"
_MARKS = ("o", "s", "^")


def difference_figure(checks: Sequence[Check]) -> Figure:
    """Draw paired differences with their 95 % intervals, in percent of the rival's RMSE."""
    rows = [(check.name, row) for check in checks for row in check.rows]
    figure = Figure(figsize=(7.6, 0.24 * len(rows) + 0.34 * len(checks) + 0.9), layout="constrained")
    axes = clean_axes(figure.subplots())
    place, ticks, labels = 0.0, [], []
    for check in checks:
        axes.text(0.0, place, check.name, transform=axes.get_yaxis_transform(), fontsize=9, color=INK,
                  fontweight="bold", va="center")  # fmt: skip
        place += 1
        for row in check.rows:
            scale = 100 / max(row["rival_deg"], 1e-9)
            low, middle, high = (row[name] * scale for name in ("low_deg", "difference_deg", "high_deg"))
            colour = GOOD if high <= 0 else BAD
            axes.plot([low, high], [place, place], color=colour, linewidth=1.6)
            axes.plot(middle, place, "o" if high <= 0 else "X", color=colour, markersize=5)
            ticks.append(place)
            labels.append(row["what"])
            place += 1
        place += 0.4
    axes.axvline(0, color=INK, linewidth=1)
    axes.set_yticks(ticks, labels)
    axes.set_ylim(place, -0.8)
    axes.grid(False, axis="y")
    axes.set_xlabel("RMSE of the policy minus that of the rival [% of the rival's]; left of 0 is better")
    return figure


def coverage_figure(check: Check, bar: float) -> Figure:
    """Draw how often the 95 % interval holds the truth under each noise, on each set of runs."""
    sets = list(dict.fromkeys(row["set"] for row in check.rows))
    noises = list(dict.fromkeys(row["what"] for row in check.rows))
    figure = Figure(figsize=(7.6, 2.9), layout="constrained")
    axes = clean_axes(figure.subplots())
    for number, name in enumerate(sets):
        rows = [row for row in check.rows if row["set"] == name]
        places = [noises.index(row["what"]) + 0.16 * (number - (len(sets) - 1) / 2) for row in rows]
        shares = [100 * row["inside"] for row in rows]
        axes.plot(places, shares, _MARKS[number % 3], label=name, color=GOOD, markersize=6,
                  markerfacecolor="white" if number == 1 else GOOD)  # fmt: skip
    axes.axhline(95, color=LINE, linewidth=1, linestyle=(0, (4, 2)))
    axes.axhline(100 * bar, color=BAD, linewidth=1)
    axes.text(len(noises) - 0.5, 100 * bar, "bar", color=BAD, fontsize=8.5, va="bottom", ha="right")
    axes.text(len(noises) - 0.5, 95, "stated", color=MUTED, fontsize=8.5, va="bottom", ha="right")
    axes.set_xticks(range(len(noises)), [name.replace(", ", "\n") for name in noises])
    axes.set_xlim(-0.5, len(noises) - 0.45)
    axes.set_ylabel("truth inside the interval [%]")
    axes.legend(frameon=False, fontsize=8.5, loc="lower left", ncols=3)
    return figure


def fault_figure(check: Check) -> Figure:
    """Draw errors under each fault, of the policy in its runtime and of the trusted filter alone."""
    rows: Sequence[Mapping[str, Any]] = check.rows
    figure = Figure(figsize=(7.6, 0.3 * len(rows) + 1.1), layout="constrained")
    axes = clean_axes(figure.subplots())
    for place, row in enumerate(rows):
        ends = [row["fallback_deg"], row["rmse_deg"]]
        axes.plot(ends, [place, place], color=LINE, linewidth=1.2)
        axes.plot(ends[0], place, "s", color=MUTED, markersize=5.5, markerfacecolor="white")
        axes.plot(
            ends[1], place, "o", color=GOOD if row["ratio"] <= (check.bar or 1.1) else BAD, markersize=5.5
        )
    axes.set_yticks(range(len(rows)), [row["fault"] for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("RMSE while the fault lasts and shortly after [deg]")
    handles = [
        Line2D([], [], marker="o", color=GOOD, linestyle="", label="policy in its runtime"),
        Line2D(
            [],
            [],
            marker="s",
            color=MUTED,
            markerfacecolor="white",
            linestyle="",
            label="trusted filter alone",
        ),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=2, frameon=False, fontsize=8.5)
    return figure


def twin_figure(check: Check) -> Figure:
    """Draw logs and what the twin, driven by their commands alone, makes of them."""
    figure = Figure(figsize=(3.8 * len(check.curves), 3.3), layout="constrained")
    grid = np.atleast_1d(figure.subplots(1, len(check.curves)))
    for axes, (name, pull, bend, predicted) in zip(grid, check.curves, strict=True):
        clean_axes(axes)
        axes.plot(pull, bend, color=LINE, linewidth=2.2, label="log")
        axes.plot(pull, predicted, color=BAD, linewidth=0.9, linestyle=(0, (4, 1.5)), label="twin, open loop")
        axes.set_title(name, fontsize=9, color=MUTED, loc="left")
        axes.set_xlabel("pulling distance [mm]")
    grid[0].set_ylabel("bending angle [deg]")
    grid[0].legend(frameon=False, fontsize=8.5)
    return figure
