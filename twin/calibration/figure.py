"""Figure of a calibration: logs beside their simulation, what is left of each, and tensions."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from twin.calibration.compared import TWIN, Compared
from twin.calibration.report import errors_deg
from twin.report.figures import INK, MUTED, clean_axes

Array = NDArray[np.float64]

MOST_DRAWN = 24
"""Largest number of logs in the figure; a picture has a largest size."""
STRIPS = 4
"""Logs from which on each is a narrow column, as short windows are."""

_MEASURED, _FITTED, _PREDICTED = "#8a939e", "#c4161c", "#1f5f99"
_RIVALS = {
    "coleman-hodgdon": ("C-H", "#6f3fa0", (0, (5, 1.5))),
    "bouc-wen": ("Bouc-Wen", "#b9811f", (0, (3, 1.2, 1, 1.2))),
    "prandtl-ishlinskii": ("P-I", "#3b7d5d", (0, (1, 1))),
}
_LABELS = {
    "bend": "bending angle [deg]",
    "error": "error [deg]",
    "tension": "tension at the pulley [N]",
    "lateral bend": "lateral bending angle [deg]",
    "lateral error": "lateral error [deg]",
}


def fit_figure(logs: Sequence[Compared]) -> Figure:
    """Plot logs and their simulation over pull, one log a column, each row on shared axes.

    Rows are the bend, its error with those of the models that are compared, the same of the second plane, and
    tensions. What was fitted is red, what was only predicted blue.

    Args:
        logs: the first `MOST_DRAWN` are drawn.
    """
    logs = logs[:MOST_DRAWN]
    rows = ["bend", "error"]
    if any(len(log.errors) > 1 for log in logs):
        rows += ["lateral bend", "lateral error"]
    if any(log.loop.tension.size for log in logs):
        rows.append("tension")
    heights = [0.62 if "error" in row else 1.0 for row in rows]
    width = 3.4 if len(logs) < STRIPS else 2.1
    figure = Figure(figsize=(width * len(logs) + 0.5, 2.8 * sum(heights)), layout="constrained")
    axes = figure.subplots(
        len(rows), len(logs), squeeze=False, sharey="row", gridspec_kw={"height_ratios": heights}
    )
    for column, log in enumerate(logs):
        for row, axis in zip(rows, axes[:, column], strict=True):
            clean_axes(axis)
            plane = int(row.startswith("lateral"))
            if plane >= len(log.errors):
                axis.set_axis_off()
                continue
            axis.set_xlabel(f"{'lateral ' * plane}pulling distance [mm]", color=INK)
            if row == "tension":
                _draw_tension(axis, log)
            elif "error" in row:
                _draw_error(axis, log, plane)
            else:
                axis.set_title(_title(log, plane), color=INK, fontsize=9)
                _draw_bend(axis, log, plane)
    for row, axis in zip(rows, axes[:, 0], strict=True):
        axis.set_ylabel(_LABELS[row], color=INK)
    return figure


def _title(log: Compared, plane: int) -> str:
    """Return the name of a log and what of it was fitted or predicted how well."""
    errors = errors_deg(log.errors[plane][TWIN], log.loop)
    said = []
    if errors["rmse_deg"] is not None:
        said.append(f"fitted within {errors['rmse_deg']:.2f}°")
    if errors["held_out_rmse_deg"] is not None:
        said.append(f"predicted within {errors['held_out_rmse_deg']:.2f}°")
        if log.loop.offset and not log.loop.fitted.any():
            said[-1] += f" ({errors['held_out_centred_rmse_deg']:.2f}° less offset)"
    line = ", ".join(said) or "the twin diverges"
    if plane:
        return line
    bend = log.loop.sheath_bend
    bent = "" if bend is None else f", sheath bent by {np.degrees(bend):.0f}°"
    return f"{_plain(log.loop.name)}{bent}\n{line}"


def _plain(name: str) -> str:
    return name.replace("$", r"\$")  # a pair of them would be mathematics


def _pull_mm(log: Compared, plane: int) -> Array:
    pull = log.loop.lateral_pull if plane else log.loop.pull
    return pull * 1e3 if pull.size else np.zeros(len(log.loop.pull))


def _draw_bend(axis: Axes, log: Compared, plane: int) -> None:
    """Draw the loop of a bending plane, measured and simulated."""
    measured = log.loop.lateral_bend if plane else log.loop.bend
    pull, error = _pull_mm(log, plane), log.errors[plane][TWIN]
    axis.plot(pull, np.degrees(measured), color=_MEASURED, lw=2.2, label="measured")
    if error is not None:
        _draw_parts(axis, log, pull, np.degrees(measured + error), "twin")
    axis.legend(frameon=False, fontsize=7, labelcolor=INK)


def _draw_parts(axis: Axes, log: Compared, pull: Array, values: Array, label: str) -> None:
    """Draw the twin's curve (N,) in the colour of what was fitted and of what was only predicted."""
    fitted = log.loop.fitted
    for mask, colour, part in ((fitted, _FITTED, "fitted"), (~fitted, _PREDICTED, "predicted")):
        if mask.any():
            shown = np.where(mask, values, np.nan)
            axis.plot(pull, shown, color=colour, lw=1.1, label=f"{label}, {part}")


def _draw_error(axis: Axes, log: Compared, plane: int) -> None:
    """Draw the errors in a bending plane over pull: of the models that are compared, and of the twin."""
    pull = _pull_mm(log, plane)
    axis.axhline(0, color=_MEASURED, lw=0.8)
    for name, error in log.errors[plane].items():
        if error is None or name == TWIN:
            continue
        label, colour, line = _RIVALS.get(name, (name, MUTED, "-"))
        rmse = next(value for value in errors_deg(error, log.loop).values() if value is not None)
        axis.plot(pull, np.degrees(error), color=colour, lw=0.8, ls=line, label=f"{label} {rmse:.2f}°")
    error = log.errors[plane][TWIN]
    if error is not None:
        _draw_parts(axis, log, pull, np.degrees(error), "twin")
    if len(axis.get_legend_handles_labels()[1]) > 2:
        axis.legend(frameon=False, fontsize=6.5, labelcolor=INK, ncols=2, loc="upper left")


def _draw_tension(axis: Axes, log: Compared) -> None:
    """Draw the tensions at the pulley over pull, measured and simulated."""
    pull = _pull_mm(log, 0)
    colour = _FITTED if log.loop.fitted.any() else _PREDICTED
    for index, line in enumerate(("-", (0, (4, 1.5)))[: log.loop.tension.shape[1]]):
        axis.plot(pull, log.loop.tension[:, index], color=_MEASURED, lw=2.0, ls=line)
        if log.episode is not None:
            axis.plot(pull, log.episode.tension[:, index], color=colour, lw=1.1, ls=line)
    said = "wire a solid, wire b dashed"
    axis.text(0.02, 0.02, said, transform=axis.transAxes, fontsize=7, color=MUTED)
