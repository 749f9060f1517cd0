"""Figures of closed-loop control: tracking and its error, input against output, errors by condition."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from twin.control.conditions import ControlCondition
from twin.control.controller import find_controllers
from twin.control.results import ControlResult
from twin.control.trial import HOLD_S, ControlTrial
from twin.estimation.methods import Style
from twin.report.figures import INK, clean_axes

REFERENCE = Style("#000000", (0, (4, 2)), "", 1.2)


def tracking_figure_of(shown: Mapping[str, ControlTrial], title: str) -> Figure:
    """Draw the bend under each controller over its error, along one reference.

    Args:
        shown: trial of each controller, all along the same reference.
        title: of the figure.
    """
    figure = Figure(figsize=(8.0, 5.4), layout="constrained")
    grid = figure.subplots(3, 1, sharex=True, height_ratios=(1.5, 1, 1))
    angle, error, pull = (clean_axes(axes) for axes in grid)
    wanted = next(iter(shown.values()))
    time = np.arange(len(wanted.reference_deg)) * wanted.sample_time - HOLD_S
    for name, trial in shown.items():
        line = _line(name)
        angle.plot(time, trial.truth_deg, **line)
        error.plot(time, trial.truth_deg - trial.reference_deg, **line)
        pull.plot(time, trial.pull_mm, **line)
    angle.plot(time, wanted.reference_deg, color=REFERENCE.colour, linestyle=REFERENCE.line, linewidth=1.2)
    error.axhline(0, color=INK, linewidth=0.6)
    for axes in grid:
        axes.axvline(0, color="#b8bec6", linewidth=0.7)
    angle.set_title(title, loc="left", fontsize=10)
    angle.set_ylabel("bending angle [deg]")
    error.set_ylabel("error [deg]")
    pull.set_ylabel("command [mm]")
    pull.set_xlabel("time since the hold at the start [s]")
    pull.set_xlim(time[0], time[-1])
    handles = [Line2D([], [], label=name, **_line(name)) for name in shown]
    handles.append(Line2D([], [], color=REFERENCE.colour, linestyle=REFERENCE.line, label="reference"))
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=8.5)
    return figure


def loop_comparison_figure(shown: Mapping[str, ControlTrial], before: str, after: str) -> Figure:
    """Draw the bend against what was wanted, without compensation and with it.

    Args:
        shown: trial of each controller.
        before: name of the one without compensation.
        after: name of the one with it.
    """
    figure = Figure(figsize=(7.2, 3.5), layout="constrained")
    for axes, name in zip(figure.subplots(1, 2, sharex=True, sharey=True), (before, after), strict=True):
        trial = shown[name]
        wanted, bend = trial.reference_deg[trial.scored], trial.truth_deg[trial.scored]
        clean_axes(axes).plot(wanted, bend, **_line(name))
        ends = [wanted.min(), wanted.max()]
        axes.plot(ends, ends, color=INK, linewidth=0.7, linestyle=(0, (4, 2)))
        axes.set_title(f"{name}: {trial.rmse_deg:.2f} deg RMSE", loc="left", fontsize=9.5)
        axes.set_xlabel("wanted angle [deg]")
        axes.set_aspect("equal")
    figure.axes[0].set_ylabel("bending angle [deg]")
    return figure


def control_errors_figure(results: Sequence[ControlResult]) -> Figure:
    """Draw the error of every controller under every condition: each twin a dot, all of them a bar."""
    conditions: list[ControlCondition] = list(dict.fromkeys(result.condition for result in results))
    names = list(dict.fromkeys(result.controller for result in results))
    apart = 0.8 / len(names)
    tall = 1.2 + 0.13 * (len(names) + 1) * len(conditions)
    figure = Figure(figsize=(8.0, max(tall, 2.6)), layout="constrained")
    axes = clean_axes(figure.subplots())
    for result in results:
        place = conditions.index(result.condition) + (names.index(result.controller) + 0.5) * apart - 0.4
        colour = _line(result.controller)["color"]
        twins = result.by_twin_deg
        across = np.full(len(twins), place)
        axes.plot(twins, across, "o", color=colour, markersize=2.8, alpha=0.55, markeredgewidth=0)
        axes.vlines(result.rmse_deg, place - 0.45 * apart, place + 0.45 * apart, color=colour, linewidth=2)
    for between in range(1, len(conditions)):
        axes.axhline(between - 0.5, color="#dfe3e8", linewidth=0.8)
    axes.grid(visible=False, axis="y")
    axes.set_xscale("log")
    axes.set_xlabel("tracking RMSE [deg]")
    axes.set_yticks(range(len(conditions)), [condition.name for condition in conditions], fontsize=8.5)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(conditions) - 0.5, -0.5)
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if _is_near(tick, axes.get_xlim())]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    handles = [Line2D([], [], color=_line(name)["color"], linewidth=2, label=name) for name in names]
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=8.5)
    return figure


def _is_near(tick: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= tick <= limits[1]


def _line(name: str) -> dict[str, Any]:
    (spec,) = find_controllers([name])
    style = spec.style
    return {"color": style.colour, "linestyle": style.line, "linewidth": style.width}
