"""Figure of a calibration: logs and their simulation, residuals, and tensions."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from twin.calibration.compared import TWIN, Compared, errors_deg
from twin.report.figures import INK, MUTED, clean_axes

Array = NDArray[np.float64]

MOST_DRAWN, COLUMNS = 24, 4  # logs in the figure, and in a row

_MEASURED, _FITTED, _PREDICTED = "#8a939e", "#c4161c", "#1f5f99"
_RIVALS = {
    "coleman-hodgdon": ("#6f3fa0", (0, (5, 1.5))),
    "bouc-wen": ("#b9811f", (0, (3, 1.2, 1, 1.2))),
    "prandtl-ishlinskii": ("#3b7d5d", (0, (1, 1))),
}
_LABELS = {"bend": "bending angle [deg]", "error": "error [deg]", "tension": "tension at the pulley [N]"}


def fit_figure(logs: Sequence[Compared]) -> Figure:
    """Plot logs and their simulation over pull, one log a column, each row on shared axes.

    Rows are the bend, its error with those of the models that are compared, the same of the second plane, and
    tensions. Fitted parts are red, predicted ones blue; of an angle whose zero is not known, a
    prediction is shown less its mean error.
    """
    logs = logs[:MOST_DRAWN]
    rows = ["bend", "error"]
    if any(len(log.errors) > 1 for log in logs):
        rows += ["lateral bend", "lateral error"]
    if any(log.loop.tension.size for log in logs):
        rows.append("tension")
    bands = [logs[first : first + COLUMNS] for first in range(0, len(logs), COLUMNS)]
    heights = [0.72 if "error" in row else 1.0 for row in rows] * len(bands)
    figure = Figure(figsize=(3.1 * len(bands[0]) + 0.5, 2.9 * sum(heights) + 0.3), layout="constrained")
    axes = figure.subplots(len(heights), len(bands[0]), squeeze=False, gridspec_kw={"height_ratios": heights})
    for band, drawn in enumerate(bands):
        below = axes[band * len(rows) : (band + 1) * len(rows)]
        for row, next_row in zip(rows, below, strict=True):
            _draw_row(row, next_row, drawn)
    for first in range(len(rows)):
        same = axes[first :: len(rows)].ravel()
        for axis in same[1:]:
            axis.sharey(same[0])
        same[0].autoscale(axis="y")
    named = {line.get_label(): line for axis in axes.ravel() for line in axis.get_legend_handles_labels()[0]}
    figure.legend(
        named.values(),
        named.keys(),
        loc="outside lower center",
        ncols=min(len(named), 2 * len(bands[0])),
        frameon=False,
        fontsize=8,
        labelcolor=INK,
    )
    return figure


def _draw_row(row: str, axes: Sequence[Axes], logs: Sequence[Compared]) -> None:
    plane = int(row.startswith("lateral"))
    for place, axis in enumerate(axes):
        log = logs[place] if place < len(logs) else None
        if log is None or plane >= len(log.errors) or (row == "tension" and not log.loop.tension.size):
            axis.set_axis_off()
            continue
        clean_axes(axis)
        axis.set_xlabel(f"{'lateral ' * plane}pulling distance [mm]", color=INK)
        if row == "tension":
            _draw_tension(axis, log)
        elif "error" in row:
            _draw_error(axis, log, plane)
        else:
            axis.set_title(_title(log, plane), color=INK, fontsize=8)
            _draw_bend(axis, log, plane)
    axes[0].set_ylabel("lateral " * plane + _LABELS[row.split()[-1]], color=INK)


def _title(log: Compared, plane: int) -> str:
    errors = errors_deg(log.errors[plane][TWIN], log.loop)
    parts = []
    if errors["rmse_deg"] is not None:
        parts.append(f"fitted within {errors['rmse_deg']:.2f}°")
    if errors["held_out_rmse_deg"] is not None:
        whole = log.loop.offset and not log.loop.fitted.any()
        centred = f" ({errors['held_out_centred_rmse_deg']:.2f}° less offset)" if whole else ""
        parts.append(f"predicted within {errors['held_out_rmse_deg']:.2f}°{centred}")
    line = ", ".join(parts) or "the twin diverges"
    if plane:
        return line
    bend = log.loop.sheath_bend
    bent = "" if bend is None else f", sheath {np.degrees(bend):.0f}°"
    name = log.loop.name.replace("$", r"\$")  # a pair of them would be mathematics
    return f"{name}{bent}\n{line}"


def _draw_bend(axis: Axes, log: Compared, plane: int) -> None:
    measured = log.loop.bend_in(plane)
    pull, error = log.loop.pull_in(plane) * 1e3, _shown(log, log.errors[plane][TWIN])
    axis.plot(pull, np.degrees(measured), color=_MEASURED, lw=2.2, label="measured")
    if error is not None:
        _draw_parts(axis, log, pull, np.degrees(measured + error))


def _shown(log: Compared, error: Array | None) -> Array | None:
    """Return an error (N,) as it is drawn: less its mean if no part was fitted and its zero is not known."""
    if error is None or log.loop.fitted.any() or not log.loop.offset:
        return error
    centred: Array = error - error[log.loop.seen].mean()
    return centred


def _draw_parts(axis: Axes, log: Compared, pull: Array, values: Array) -> None:
    """Draw the twin's curve (N,) in the colour of what was fitted and of what was only predicted."""
    fitted = log.loop.fitted
    for mask, colour, part in ((fitted, _FITTED, "fitted"), (~fitted, _PREDICTED, "predicted")):
        if mask.any():
            shown = np.where(mask, values, np.nan)
            axis.plot(pull, shown, color=colour, lw=1.1, label=f"twin, {part}")


def _draw_error(axis: Axes, log: Compared, plane: int) -> None:
    pull = log.loop.pull_in(plane) * 1e3
    axis.axhline(0, color=_MEASURED, lw=0.8)
    parts = []
    for name, error in log.errors[plane].items():
        shown = _shown(log, error)
        if shown is None or name == TWIN:
            continue
        colour, line = _RIVALS.get(name, (MUTED, "-"))
        axis.plot(pull, np.degrees(shown), color=colour, lw=0.8, ls=line, label=name.title())
        initials = "-".join(part[0].upper() for part in name.split("-"))
        values = [*errors_deg(shown, log.loop).values()][:2]  # fitted, predicted
        parts.append(f"{initials} {' / '.join(f'{value:.2f}°' for value in values if value is not None)}")
    if parts:
        axis.set_title(", ".join(parts), color=INK, fontsize=7)
    twin = _shown(log, log.errors[plane][TWIN])
    if twin is not None:
        _draw_parts(axis, log, pull, np.degrees(twin))


def _draw_tension(axis: Axes, log: Compared) -> None:
    pull = log.loop.episode.pull * 1e3
    colour = _FITTED if log.loop.fitted.any() else _PREDICTED
    for index, line in enumerate(("-", (0, (4, 1.5)))[: log.loop.tension.shape[1]]):
        axis.plot(pull, log.loop.tension[:, index], color=_MEASURED, lw=2.0, ls=line)
        if log.episode is not None:
            axis.plot(pull, log.episode.tension[:, index], color=colour, lw=1.1, ls=line)
    axis.set_title("wire a solid, wire b dashed", color=INK, fontsize=7)
