"""Report of a calibration: errors on every log, parameters with their uncertainty, and a figure."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import predict
from twin.calibration.parameters import FreeParameters
from twin.calibration.search import Fit
from twin.calibration.uncertainty import Uncertainty
from twin.episode import Episode
from twin.errors import DivergedError, InputError
from twin.identification import identify
from twin.report.figures import INK, MUTED, clean_axes

Array = NDArray[np.float64]

MOST_DRAWN = 24  # logs in the figure; a picture has a largest size
_MEASURED, _TWIN = "#8a939e", "#c4161c"


def fit_report(
    fit: Fit, free: FreeParameters, known: Uncertainty, loops: Sequence[MeasuredLoop], seed: int
) -> tuple[dict[str, Any], list[Episode | None]]:
    """Simulate the fitted preset along every log and compare; what cannot be said of a log is None.

    Beside the twin stands a Coleman-Hodgdon model fitted to the same samples of each log alone: what a
    phenomenological model, which knows neither tension nor sheath, makes of them.

    Returns:
        Plain values, for JSON; and the simulated record of each log, None where the simulation diverges.
    """
    episodes = predict([fit.preset], loops)[0]
    logs = [_of_log(loop, episode, seed) for loop, episode in zip(loops, episodes, strict=True)]
    diverged = [
        f"the calibrated twin diverges along {loop.name}"
        for loop, episode in zip(loops, episodes, strict=True)
        if episode is None
    ]
    values = {
        "cost": fit.cost,
        "evaluations": fit.evaluations,
        "optimizer": "CMA-ES, then trust-region least squares",
        "seed": seed,
        "logs": logs,
        "parameters": {
            name: {"value": getattr(fit.preset, name), "standard_deviation": _finite(known.deviation[name])}
            for name in free.names
        },
        "warnings": [*known.warnings, *diverged],
    }
    return values, episodes


def _of_log(loop: MeasuredLoop, episode: Episode | None, seed: int) -> dict[str, Any]:
    held_out = ~loop.fitted
    off = None if episode is None else np.degrees(episode.bend - loop.bend)
    own = _coleman_hodgdon_error(loop, seed)
    values: dict[str, Any] = {
        "name": loop.name,
        "sheath_bend_deg": None if loop.sheath_bend is None else float(np.degrees(loop.sheath_bend)),
        "rmse_deg": None if off is None else _rmse(off[loop.fitted]),
        "held_out_rmse_deg": None if off is None else _rmse(off[held_out]),
        "coleman_hodgdon_rmse_deg": None if own is None else _rmse(own[loop.fitted]),
        "coleman_hodgdon_held_out_rmse_deg": None if own is None else _rmse(own[held_out]),
    }
    scored = loop.fitted if loop.fitted.any() else held_out
    for index, wire in enumerate("ab"[: loop.tension.shape[1]]):
        measured = loop.tension[:, index]
        rmse = None if episode is None else _rmse((episode.tension[:, index] - measured)[scored])
        span = float(np.ptp(measured))  # zero for a wire that stays slack
        values[f"tension_{wire}_rmse_n"] = rmse
        values[f"tension_{wire}_rmse_percent_of_range"] = (
            None if rmse is None or span == 0 else 100 * rmse / span
        )
    return values


def _coleman_hodgdon_error(loop: MeasuredLoop, seed: int) -> Array | None:
    """Return the error (N,) [deg] of a Coleman-Hodgdon model fitted to the log alone, or None without a fit.

    The model is odd about zero: it gets the log centred, or it could not follow.
    """
    if not loop.fitted.any():
        return None
    pull_mm = _centred(loop.pull * 1e3, loop.fitted)
    bend_deg = _centred(np.degrees(loop.bend), loop.fitted)
    try:
        model, _ = identify([(pull_mm[loop.fitted], bend_deg[loop.fitted])], seed)
    except (InputError, DivergedError):  # its rules on loops are stricter than those of a calibration
        return None
    error: Array = model.response(pull_mm, bend_deg[0]) - bend_deg
    return error if np.isfinite(error).all() else None


def fit_figure(loops: Sequence[MeasuredLoop], episodes: Sequence[Episode | None]) -> Figure:
    """Plot logs and their simulation: bend over pull, and the tensions where they were measured.

    Args:
        loops: the logs; the first `MOST_DRAWN` are drawn.
        episodes: their simulation, None where it diverged.
    """
    loops, episodes = loops[:MOST_DRAWN], episodes[:MOST_DRAWN]
    with_tension = any(loop.tension.size for loop in loops)
    rows = 2 if with_tension else 1
    figure = Figure(figsize=(3.4 * len(loops) + 0.4, 2.9 * rows), layout="constrained")
    axes = figure.subplots(rows, len(loops), squeeze=False, sharex="col")
    for column, (loop, episode) in enumerate(zip(loops, episodes, strict=True)):
        pull = loop.pull * 1e3
        top = clean_axes(axes[0, column])
        top.plot(pull, np.degrees(loop.bend), color=_MEASURED, lw=2.2, label="measured")
        said = "the twin diverges"
        if episode is not None:
            top.plot(pull, np.degrees(episode.bend), color=_TWIN, lw=1.1, label="twin")
            said = f"RMSE {_rmse(np.degrees(episode.bend - loop.bend)):.2f}°"
        bent = "" if loop.sheath_bend is None else f", sheath bent by {np.degrees(loop.sheath_bend):.0f}°"
        name = loop.name.replace("$", r"\$")  # a pair of them would be mathematics
        top.set_title(f"{name}{bent}\n{said}", color=INK, fontsize=9)
        if with_tension:
            bottom = clean_axes(axes[1, column])
            for index, line in enumerate(("-", (0, (4, 1.5)))[: loop.tension.shape[1]]):
                bottom.plot(pull, loop.tension[:, index], color=_MEASURED, lw=2.0, ls=line)
                if episode is not None:
                    bottom.plot(pull, episode.tension[:, index], color=_TWIN, lw=1.1, ls=line)
        axes[-1, column].set_xlabel("pulling distance [mm]", color=INK)
    axes[0, 0].set_ylabel("bending angle [deg]", color=INK)
    axes[0, 0].legend(frameon=False, fontsize=8, labelcolor=INK)
    if with_tension:
        axes[1, 0].set_ylabel("tension at the pulley [N]", color=INK)
        axes[1, 0].text(
            0.02, 0.02, "wire a solid, wire b dashed", transform=axes[1, 0].transAxes, fontsize=7, color=MUTED
        )
    return figure


def _centred(values: Array, among: NDArray[np.bool_]) -> Array:
    centred: Array = values - (values[among].max() + values[among].min()) / 2
    return centred


def _rmse(off: Array) -> float | None:
    """Return the root mean square of errors, or None if there are none."""
    return float(np.sqrt(np.mean(off**2))) if off.size else None


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
