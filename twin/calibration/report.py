"""Report of a calibration: errors on every log, and parameters with their uncertainty."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.calibration.fit import Fit
from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import bend_errors, offset_of, predict
from twin.calibration.uncertainty import Uncertainty
from twin.episode import Episode
from twin.errors import DivergedError, InputError
from twin.identification import identify

Array = NDArray[np.float64]


def fit_report(
    fit: Fit, known: Uncertainty, loops: Sequence[MeasuredLoop], seed: int
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
        "reduced_cost": fit.reduced_cost,
        "optimizer": "trust-region least squares from many starts on the reduced twin, corrected in MuJoCo",
        "seed": seed,
        "logs": logs,
        "parameters": {
            name: {"value": getattr(fit.preset, name), "standard_deviation": _finite(known.deviation[name])}
            for name in fit.free.names
        },
        "warnings": [*known.warnings, *diverged],
    }
    return values, episodes


def _of_log(loop: MeasuredLoop, episode: Episode | None, seed: int) -> dict[str, Any]:
    errors = None if episode is None else bend_errors(episode, loop)
    values: dict[str, Any] = {
        "name": loop.name,
        "sheath_bend_deg": None if loop.sheath_bend is None else float(np.degrees(loop.sheath_bend)),
        **_of_plane(loop, loop.pull, loop.bend, errors[0] if errors else None, seed),
    }
    if loop.lateral_bend.size:
        pull = loop.lateral_pull if loop.lateral_pull.size else np.zeros_like(loop.pull)
        lateral = _of_plane(loop, pull, loop.lateral_bend, errors[1] if errors else None, seed)
        values |= {f"lateral_{name}": value for name, value in lateral.items()}
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


def _of_plane(
    loop: MeasuredLoop, pull: Array, bend: Array, error: Array | None, seed: int
) -> dict[str, float | None]:
    """Return the errors in one bending plane, from how far the twin is above the measured angle (N,) [rad].

    An offset is that of the fitted samples; what is only predicted is scored without one.
    """
    held_out = ~loop.fitted & loop.seen
    off = offset = centred = None
    if error is not None:
        offset = np.degrees(offset_of(error, loop)) if loop.fitted.any() else 0.0
        off = np.degrees(error) - offset
        centred = off[held_out] - off[held_out].mean() if held_out.any() else off[:0]
    own = _coleman_hodgdon_error(loop, pull, bend, seed)
    return {
        "offset_deg": offset if loop.offset else None,
        "rmse_deg": None if off is None else _rmse(off[loop.fitted]),
        "held_out_rmse_deg": None if off is None else _rmse(off[held_out]),
        "held_out_centred_rmse_deg": None if centred is None else _rmse(centred),
        "coleman_hodgdon_rmse_deg": None if own is None else _rmse(own[loop.fitted]),
        "coleman_hodgdon_held_out_rmse_deg": None if own is None else _rmse(own[held_out]),
    }


def _coleman_hodgdon_error(loop: MeasuredLoop, pull: Array, bend: Array, seed: int) -> Array | None:
    """Return the error (N,) [deg] of a Coleman-Hodgdon model fitted to a plane alone, or None without a fit.

    The model is odd about zero: it gets the log centred, or it could not follow.
    """
    if not loop.fitted.any():
        return None
    pull_mm = _centred(pull * 1e3, loop.fitted)
    bend_deg = _centred(np.degrees(bend), loop.fitted)
    try:
        model, _ = identify([(pull_mm[loop.fitted], bend_deg[loop.fitted])], seed)
    except (InputError, DivergedError):  # its rules on loops are stricter than those of a calibration
        return None
    error: Array = model.response(pull_mm, bend_deg[0]) - bend_deg
    return error if np.isfinite(error).all() else None


def _centred(values: Array, among: NDArray[np.bool_]) -> Array:
    centred: Array = values - (values[among].max() + values[among].min()) / 2
    return centred


def _rmse(off: Array) -> float | None:
    """Return the root mean square of errors, or None if there are none."""
    return float(np.sqrt(np.mean(off**2))) if off.size else None


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
