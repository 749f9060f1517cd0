"""Report of a calibration: errors on every log, and parameters with their uncertainty."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.calibration.compared import TWIN, Compared
from twin.calibration.fit import Fit
from twin.calibration.measured import MeasuredLoop
from twin.calibration.uncertainty import Uncertainty

Array = NDArray[np.float64]


def fit_report(fit: Fit, known: Uncertainty, logs: Sequence[Compared], seed: int) -> dict[str, Any]:
    """Return errors on every log, and parameters, as plain values for JSON; what cannot be said is None."""
    diverged = [f"the calibrated twin diverges along {log.loop.name}" for log in logs if log.episode is None]
    return {
        "cost": fit.cost,
        "reduced_cost": fit.reduced_cost,
        "optimizer": "trust-region least squares from many starts on the reduced twin, corrected in MuJoCo",
        "seed": seed,
        "logs": [_of_log(log) for log in logs],
        "parameters": {
            name: {"value": getattr(fit.preset, name), "standard_deviation": _finite(known.deviation[name])}
            for name in fit.free.names
        },
        "warnings": [*known.warnings, *diverged],
    }


def _of_log(log: Compared) -> dict[str, Any]:
    loop, episode = log.loop, log.episode
    values: dict[str, Any] = {
        "name": loop.name,
        "sheath_bend_deg": None if loop.sheath_bend is None else float(np.degrees(loop.sheath_bend)),
    }
    for plane, errors in enumerate(log.errors):
        prefix = "lateral_" if plane else ""
        known = loop.offset and errors[TWIN] is not None
        values[f"{prefix}offset_deg"] = float(np.degrees(log.offsets[plane])) if known else None
        for name, error in errors.items():
            whose = prefix if name == TWIN else f"{prefix}{name.replace('-', '_')}_"
            values |= {f"{whose}{key}": value for key, value in errors_deg(error, loop).items()}
    scored = loop.fitted if loop.fitted.any() else loop.seen
    for index, wire in enumerate("ab"[: loop.tension.shape[1]]):
        measured = loop.tension[:, index]
        rmse = None if episode is None else _rmse((episode.tension[:, index] - measured)[scored])
        span = float(np.ptp(measured))  # zero for a wire that stays slack
        values[f"tension_{wire}_rmse_n"] = rmse
        values[f"tension_{wire}_rmse_percent_of_range"] = (
            None if rmse is None or span == 0 else 100 * rmse / span
        )
    return values


def errors_deg(error: Array | None, loop: MeasuredLoop) -> dict[str, float | None]:
    """Return the RMSE of an error (N,) [rad] where a log was fitted and where it was only predicted [deg]."""
    if error is None:
        return dict.fromkeys(("rmse_deg", "held_out_rmse_deg", "held_out_centred_rmse_deg"))
    off, held_out = np.degrees(error), ~loop.fitted & loop.seen
    centred = off[held_out] - off[held_out].mean() if held_out.any() else off[:0]
    return {
        "rmse_deg": _rmse(off[loop.fitted]),
        "held_out_rmse_deg": _rmse(off[held_out]),
        "held_out_centred_rmse_deg": _rmse(centred),
    }


def _rmse(off: Array) -> float | None:
    """Return the root mean square of errors, or None if there are none."""
    return float(np.sqrt(np.mean(off**2))) if off.size else None


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
