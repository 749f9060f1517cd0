"""Plots beside a picture: the loop, bend over pull, of either bending plane, or the bend over time."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.rendering.beside import Beside, curves_of
from twin.rendering.theme import Theme
from twin.rendering.trace_panel import Curve, Plot

Array = NDArray[np.float64]

PULL_LABEL, TIME_LABEL, BEND_LABEL = "pulling distance [mm]", "time [s]", "bending angle [deg]"


def plot_of(episode: Episode, beside: Beside, theme: Theme) -> Plot:
    """Return the bend over time where a reference is known, else the loop."""
    return over_time(episode, beside, theme) if beside.has_reference else loop(episode, beside, theme)


def loop(episode: Episode, beside: Beside, theme: Theme) -> Plot:
    """Return bending angle over pulling distance: the whole loop stands pale behind its trace."""
    moving, still = (curves_of("pull_mm", episode, beside, theme, moving=moves) for moves in (True, False))
    return Plot(episode.pull_mm, episode.truth_deg, PULL_LABEL, BEND_LABEL, tuple(moving), tuple(still))


def lateral_loop(episode: Episode, theme: Theme) -> Plot:
    """Return the loop of the second bending plane, of wires c and d."""
    pull_mm, bend_deg = episode.lateral_pull * 1e3, np.degrees(episode.lateral_bend)
    if len(pull_mm) == 0:  # wire c is held
        pull_mm = np.zeros(len(bend_deg))
    moving, still = (Curve(pull_mm, bend_deg, colour) for colour in (theme.pale, theme.trace))
    labels = f"lateral {PULL_LABEL}", f"lateral {BEND_LABEL}"
    return Plot(pull_mm, bend_deg, *labels, (moving,), (still,), is_main=False)


def over_time(episode: Episode, beside: Beside, theme: Theme) -> Plot:
    """Return bending angle over time: the reference, and the whole bend pale behind its trace."""
    reference = Curve(episode.time, beside.reference_deg, theme.ink, dashed=True, name="reference", width=1.3)
    known = [reference] if beside.has_reference else []
    moving, still = (
        curves_of("time", episode, beside, theme, moving=moves) + known for moves in (True, False)
    )
    return Plot(episode.time, episode.truth_deg, TIME_LABEL, BEND_LABEL, tuple(moving), tuple(still), "time")


def on_common_axes(plots: Sequence[Plot]) -> list[Plot]:
    """Return plots whose axes have the limits that hold all of them."""
    curves = [curve for plot in plots for curve in (*plot.still, *plot.moving) if len(curve.x)]
    limits = (
        _with_margin(np.concatenate([curve.x for curve in curves])),
        _with_margin(np.concatenate([curve.y for curve in curves])),
    )
    return [plot._replace(limits=limits) for plot in plots]


def _with_margin(values: Array) -> tuple[float, float]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.06 * max(high - low, 1e-9)
    return low - margin, high + margin
