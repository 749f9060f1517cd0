"""Figure of a calibration: logs and their simulation, bend over pull in each plane, and tensions."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import offset_of
from twin.episode import Episode
from twin.report.figures import INK, MUTED, clean_axes

Array = NDArray[np.float64]

MOST_DRAWN = 24
"""Largest number of logs in the figure; a picture has a largest size."""

_MEASURED, _TWIN = "#8a939e", "#c4161c"


def fit_figure(loops: Sequence[MeasuredLoop], episodes: Sequence[Episode | None]) -> Figure:
    """Plot logs and their simulation: bend over pull, in the second plane too, and tensions over pull.

    Args:
        loops: the logs; the first `MOST_DRAWN` are drawn, one a column.
        episodes: their simulation, None where it diverged.
    """
    loops, episodes = loops[:MOST_DRAWN], episodes[:MOST_DRAWN]
    rows = ["bend"]
    if any(loop.tension.size for loop in loops):
        rows.append("tension")
    if any(loop.lateral_bend.size for loop in loops):
        rows.append("lateral bend")
    figure = Figure(figsize=(3.4 * len(loops) + 0.4, 2.9 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), len(loops), squeeze=False)
    for column, (loop, episode) in enumerate(zip(loops, episodes, strict=True)):
        for row, axis in zip(rows, axes[:, column], strict=True):
            clean_axes(axis)
            axis.set_xlabel("pulling distance [mm]", color=INK)
            if row == "bend":
                said = _draw_bend(axis, loop, episode)
                bend = loop.sheath_bend
                bent = "" if bend is None else f", sheath bent by {np.degrees(bend):.0f}°"
                name = loop.name.replace("$", r"\$")  # a pair of them would be mathematics
                axis.set_title(f"{name}{bent}\n{said}", color=INK, fontsize=9)
            elif row == "tension":
                _draw_tension(axis, loop, episode)
            elif loop.lateral_bend.size:
                axis.set_title(_draw_bend(axis, loop, episode, plane=1), color=INK, fontsize=9)
                axis.set_xlabel("lateral pulling distance [mm]", color=INK)
    labels = {
        "bend": "bending angle [deg]",
        "tension": "tension at the pulley [N]",
        "lateral bend": "lateral bending angle [deg]",
    }
    for row, axis in zip(rows, axes[:, 0], strict=True):
        axis.set_ylabel(labels[row], color=INK)
        if row == "tension":
            said = "wire a solid, wire b dashed"
            axis.text(0.02, 0.02, said, transform=axis.transAxes, fontsize=7, color=MUTED)
    axes[0, 0].legend(frameon=False, fontsize=8, labelcolor=INK)
    return figure


def _draw_bend(axis: Axes, loop: MeasuredLoop, episode: Episode | None, plane: int = 0) -> str:
    """Draw the loop of a bending plane, measured and simulated; returns the twin's error in words."""
    measured = (loop.bend, loop.lateral_bend)[plane]
    pull = (loop.pull, loop.lateral_pull if loop.lateral_pull.size else np.zeros_like(measured))[plane] * 1e3
    axis.plot(pull, np.degrees(measured), color=_MEASURED, lw=2.2, label="measured")
    if episode is None:
        return "the twin diverges"
    simulated = (episode.bend, episode.lateral_bend)[plane]
    shown = simulated - offset_of(simulated - measured, loop)
    axis.plot(pull, np.degrees(shown), color=_TWIN, lw=1.1, label="twin")
    return f"RMSE {np.degrees(np.sqrt(np.mean((shown - measured) ** 2))):.2f}°"


def _draw_tension(axis: Axes, loop: MeasuredLoop, episode: Episode | None) -> None:
    pull = loop.pull * 1e3
    for index, line in enumerate(("-", (0, (4, 1.5)))[: loop.tension.shape[1]]):
        axis.plot(pull, loop.tension[:, index], color=_MEASURED, lw=2.0, ls=line)
        if episode is not None:
            axis.plot(pull, episode.tension[:, index], color=_TWIN, lw=1.1, ls=line)
