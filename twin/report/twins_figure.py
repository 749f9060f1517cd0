"""Figure of both twins along one record: their loops, and how the difference falls with MuJoCo's step."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from twin.episode import Episode
from twin.errors import InputError
from twin.report.figures import INK, MUTED, clean_axes

SHADES = ("#b9501f", "#2b6ca3", "#111111")


def twins_figure(reduced: Episode, steps: Sequence[tuple[str, Episode]]) -> Figure:
    """Draw the loop of both twins, and their difference over time at several steps of MuJoCo.

    Args:
        reduced: record of the reduced twin.
        steps: up to three labelled records of the twin in MuJoCo along the same command, coarsest first.

    Raises:
        ValueError: there is none, there are more than three, or one is of another length.
    """
    if not 1 <= len(steps) <= len(SHADES):
        raise InputError(f"{len(steps)} records of MuJoCo: must be 1 to {len(SHADES)}")
    if any(len(record.bend) != len(reduced.bend) for _, record in steps):
        raise InputError("records of both twins must have as many samples")
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    loop, away = figure.subplots(1, 2, width_ratios=(1, 1.5))
    clean_axes(loop)
    clean_axes(away)
    loop.plot(1e3 * reduced.pull, steps[0][1].truth_deg, color=INK, linewidth=2.2, label="MuJoCo")
    loop.plot(1e3 * reduced.pull, reduced.truth_deg, color=SHADES[0], linewidth=0.9, label="reduced")
    loop.set_xlabel("pull [mm]")
    loop.set_ylabel("bend [deg]")
    loop.legend(frameon=False, fontsize=8)
    for (label, record), colour in zip(steps, SHADES, strict=False):
        difference = reduced.truth_deg - record.truth_deg
        away.plot(reduced.time, difference, color=colour, linewidth=1.0, label=label)
    away.axhline(0.0, color=MUTED, linewidth=0.6, zorder=0)
    away.set_xlabel("time [s]")
    away.set_ylabel("reduced less MuJoCo [deg]")
    away.legend(frameon=False, fontsize=8, ncols=len(steps), loc="upper center", bbox_to_anchor=(0.5, 1.14))
    largest = max(float(np.abs(reduced.truth_deg - record.truth_deg).max()) for _, record in steps)
    away.set_ylim(-1.15 * largest, 1.15 * largest)
    return figure
