"""Sufficiency of the twin, on which all evidence on simulated twins rests: it is compared with the logs.

The preset's own twin is driven by the commands of the logs and sees no measurement. It must predict them at
least as well as a three-parameter model of hysteresis that was fitted to each of these logs.
"""

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Record, without_holes
from twin.gate.check import GIVE_LOGS, TWIN, Check, declare, not_shown
from twin.gate.evidence import OTHER_STREAMS, GateMaterial
from twin.hysteresis.width import without_hysteresis
from twin.identification.models import identify_coleman_hodgdon
from twin.identification.search import reverses
from twin.reduced import simulate_batch

Array = NDArray[np.float64]
ZERO_DEG = 0.5  # offset of a log that need not be known
LEAST_SHARE = 0.02
"""Share of the logs' range of bend below which no twin need be: repeats of a device differ as much."""
_STREAM = OTHER_STREAMS + 2
_DRAWN = 2  # logs on the page
_BENDS = 9  # of the sheath, that are tried where a log has none of its own


@functools.lru_cache(maxsize=1)
def _predictions(material: GateMaterial) -> list[tuple[Array | None, float | None]]:
    """Return the twin's angle along each log [deg] and the bend of its sheath [rad]; two checks share it."""
    logs = zip(material.logs, material.sheath_bends, strict=True)
    return [_predicted(log, sheath_bend, material) for log, sheath_bend in logs]


@declare("the zero of the sensor", TWIN, GIVE_LOGS)
def zero_of_logs(material: GateMaterial) -> Check:
    """Logs and twin agree about where the section is straight."""
    pairs = [
        (log, predicted)
        for log, (predicted, _) in zip(material.logs, _predictions(material), strict=True)
        if log.is_measured and predicted is not None
    ]
    if not pairs:
        return Check(said="no measured log was given", required=False)
    offsets = [float(np.nanmean(log.reference_deg - predicted)) for log, predicted in pairs]
    sensor, worst = material.sensor, max(offsets, key=abs)
    bar = max(ZERO_DEG, 3 * sensor.zero_deviation_deg)
    zero = sensor.zero_deg + float(np.mean(offsets)) * sensor.scale
    said = f"the zero of the logs is within {abs(worst):.2f} deg of the stated one, {sensor.zero_deg:.2f} deg"
    if abs(worst) > bar:
        stated = f"by the stated zero of {sensor.zero_deg:.2f} deg"
        said = f"the angle of a log is {worst:+.2f} deg off the twin's, {stated}"
    return Check(
        said=said,
        remedy=f"State the sensor's zero (--sensor-zero-deg {zero:.2f}), or calibrate again.",
        figure=abs(worst),
        bar=bar,
        unit="deg",
        holds=abs(worst) <= bar,
        rows=tuple(
            {"log": log.name, "offset_deg": offset} for (log, _), offset in zip(pairs, offsets, strict=True)
        ),
    )


@declare(
    "the twin reproduces the logs",
    TWIN,
    "Calibrate the preset on these logs, and train again on it: evidence on its twins shows little about "
    "this endoscope.",
    2,
)
def twin_of_logs(material: GateMaterial) -> Check:
    """The preset's twin reproduces this endoscope."""
    if not material.logs:
        return not_shown("no log was given: whether the twin is like the endoscope is not known", GIVE_LOGS)
    errors, curves = [], []
    rows: list[dict[str, Any]] = []
    for log, (predicted, bend) in zip(material.logs, _predictions(material), strict=True):
        if predicted is None:
            said = f"the twin finds no equilibrium along the command of {log.name}"
            return Check(said=said, holds=False, unit="deg")
        angle = without_holes(log.time, log.reference_deg)
        if log.is_measured:  # its zero is at some pose
            predicted = predicted - np.nanmean(predicted - log.reference_deg)
        errors.append(_error(log, predicted))
        curves.append((log.name, log.pull_mm, angle, predicted))
        rows.append(
            {
                "log": log.name,
                "rmse_deg": float(np.sqrt(np.mean(errors[-1] ** 2))),
                "range_deg": float(np.nanmax(log.reference_deg) - np.nanmin(log.reference_deg)),
                "sheath_bend_deg": None if bend is None else float(np.degrees(bend)),
            }
        )
        material.on_progress(0.7 * len(rows) / len(material.logs))
    fitted = _fitted([log for log in material.logs if reverses(log.pull_mm)], material)
    trials = material.on_logs
    squares = np.concatenate([trial.squares for trial in trials], axis=1).mean(axis=1)
    for row, square in zip(rows, squares.tolist(), strict=True):
        row["policy_rmse_deg"] = float(np.sqrt(square))
    found = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    least = LEAST_SHARE * max(row["range_deg"] for row in rows)
    bar = max(fitted, least)
    holds = found <= bar
    compared = (
        f"Coleman-Hodgdon models fitted to each leave {fitted:.2f} deg"
        if fitted > least
        else f"{LEAST_SHARE:.0%} of their range are {bar:.2f} deg"
    )
    said = f"driven by the commands alone the twin is {found:.2f} deg off the logs; {compared}"
    notes = ["The twin sees no measurement. Measured logs are smoothed, their mean difference is subtracted."]
    notes += without_hysteresis((log.name, log.pull_mm, log.reference_deg) for log in material.logs)
    if any(row["sheath_bend_deg"] is not None for row in rows):
        notes.append("Where a log has no bend of its sheath, the best of nine bends is used.")
    return Check(
        said=said,
        figure=found,
        bar=bar,
        unit="deg",
        holds=holds,
        rows=tuple(rows),
        notes=tuple(notes),
        curves=tuple(curves[:_DRAWN]),
    )


def _predicted(log: Record, sheath_bend: Array, material: GateMaterial) -> tuple[Array | None, float | None]:
    """Return the twin's angle along a log [deg], and the bend of the sheath that fits it best [rad]."""
    pull, preset, T = log.pull_mm * 1e-3, material.preset, material.sample_time
    limits = {name: (low, high) for name, low, high in material.ranges.limits}.get("sheath_bend")
    if sheath_bend.size or limits is None:
        # Wires are wound up in a sheath that is bent already: it begins there.
        begins = preset.replace(sheath_bend=float(sheath_bend[0])) if sheath_bend.size else preset
        course = sheath_bend if sheath_bend.size else None
        (episode,) = simulate_batch([begins], [pull], T, sheath_bends=[course])
        return (None if episode is None else episode.truth_deg), None
    bends = np.unique([preset.sheath_bend, *np.linspace(*limits, _BENDS)]).tolist()
    episodes = simulate_batch([preset.replace(sheath_bend=bend) for bend in bends], [pull] * len(bends), T)
    found = [(of.truth_deg, bend) for of, bend in zip(episodes, bends, strict=True) if of is not None]
    if not found:
        return None, None
    return min(found, key=lambda pair: float(np.mean(_error(log, pair[0]) ** 2)))


def _error(log: Record, predicted: Array) -> Array:
    """Return the errors where the angle is known [deg]; for a measured log, without their mean."""
    error = predicted - log.reference_deg
    error = error[np.isfinite(error)]
    return error - error.mean() if log.is_measured else error


def _fitted(logs: list[Record], material: GateMaterial) -> float:
    """Return the RMSE of Coleman-Hodgdon models fitted to each log [deg]; 0, where none reverses."""
    if not logs:
        return 0.0
    seed = int(material.random(_STREAM).integers(2**31))
    errors = []
    for log in logs:
        angle = without_holes(log.time, log.reference_deg)
        model, _ = identify_coleman_hodgdon([(log.pull_mm, angle)], seed, population=40, generations=60)
        errors.append(_error(log, model.response(log.pull_mm, float(angle[0]))))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
