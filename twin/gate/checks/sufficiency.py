"""Sufficiency of the twin: what all evidence on simulated twins rests on, held against the logs themselves.

The preset's own twin is driven by the commands of the logs and sees no measurement. It must predict them at
least as well as a three-parameter model of hysteresis that was fitted to each of these very logs.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.gate.material import OTHER_STREAMS, GateLog, GateMaterial
from twin.gate.result import Check, not_shown
from twin.identification.coleman_hodgdon import identify_coleman_hodgdon
from twin.reduced import simulate_batch

Array = NDArray[np.float64]
SUFFICIENT = "the twin is a picture of the logs"
LEAST_SHARE = 0.02
"""Share of the logs' range of bend below which no twin need be: repeats of a device differ as much."""
_STREAM = OTHER_STREAMS + 2
_DRAWN = 2  # logs on the page
_BENDS = 9  # of the sheath, that are tried where a log does not tell its own


def twin_of_logs(material: GateMaterial) -> Check:
    """Compare the twin's open-loop prediction of the logs with that of a model fitted to them."""
    if not material.logs:
        return not_shown(SUFFICIENT, "no log was given: whether the twin is like the endoscope is not known")
    errors, rows, curves = [], [], []
    for log in material.logs:
        predicted, bend = _predicted(log, material)
        if predicted is None:
            return Check(
                SUFFICIENT,
                f"the twin finds no equilibrium along the command of {log.record.name}",
                holds=False,
                unit="deg",
            )
        error = _error(log, predicted)
        if log.is_measured:  # its zero is at some pose
            predicted = predicted - (predicted - log.record.bend_deg)[log.record.seen].mean()
        errors.append(error)
        curves.append((log.record.name, log.record.pull_mm, log.record.bend_deg, predicted))
        rows.append(
            {
                "log": log.record.name,
                "rmse_deg": float(np.sqrt(np.mean(error**2))),
                "range_deg": float(np.ptp(log.record.bend_deg[log.record.seen])),
                "sheath_bend_deg": None if bend is None else float(np.degrees(bend)),
            }
        )
        material.tell(0.7 * len(rows) / len(material.logs))
    moving = [log for log in material.logs if _reverses(log)]
    fitted = _fitted(moving, material)
    of_policy = _of_policy(material)
    for row in rows:
        row["policy_rmse_deg"] = of_policy.get(str(row["log"]))
    found = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    widest = max(float(str(row["range_deg"])) for row in rows)
    bar = max(fitted, LEAST_SHARE * widest)
    holds = found <= bar
    compared = (
        f"Coleman-Hodgdon models fitted to each leave {fitted:.2f} deg"
        if fitted > LEAST_SHARE * widest
        else f"{LEAST_SHARE:.0%} of their range are {bar:.2f} deg"
    )
    said = f"driven by the commands alone the twin is {found:.2f} deg off the logs; {compared}"
    if not holds:
        said += ": calibrate the preset first, evidence on its twins says little of this endoscope"
    notes = ["The twin sees no measurement. Of measured logs the offset of their zero is taken out."]
    if any(row["sheath_bend_deg"] is not None for row in rows):
        notes.append("Where a log does not tell how far its sheath is bent, the best of nine bends is taken.")
    return Check(
        SUFFICIENT,
        said,
        figure=found,
        bar=bar,
        unit="deg",
        holds=holds,
        rows=tuple(rows),
        notes=tuple(notes),
        curves=tuple(curves[:_DRAWN]),
    )


def _predicted(log: GateLog, material: GateMaterial) -> tuple[Array | None, float | None]:
    """Return the twin's angle along a log [deg], and the bend of the sheath that was sought for it [rad]."""
    pull, preset, T = log.record.pull_mm * 1e-3, material.preset, material.sample_time
    limits = {name: (low, high) for name, low, high in material.ranges.limits}.get("sheath_bend")
    if log.sheath_bend.size or limits is None:
        # Wires are wound up in a sheath that is bent already: it begins there.
        begins = preset.replace(sheath_bend=float(log.sheath_bend[0])) if log.sheath_bend.size else preset
        course = log.sheath_bend if log.sheath_bend.size else None
        (episode,) = simulate_batch([begins], [pull], T, sheath_bends=[course])
        return (None if episode is None else episode.truth_deg), None
    bends = np.unique([preset.sheath_bend, *np.linspace(*limits, _BENDS)]).tolist()
    episodes = simulate_batch([preset.replace(sheath_bend=bend) for bend in bends], [pull] * len(bends), T)
    whole = [(of.truth_deg, bend) for of, bend in zip(episodes, bends, strict=True) if of is not None]
    if not whole:
        return None, None
    return min(whole, key=lambda found: float(np.mean(_error(log, found[0]) ** 2)))


def _error(log: GateLog, predicted: Array) -> Array:
    """Return the errors where the angle is known [deg]; of a measured log, without their mean."""
    error: Array = (predicted - log.record.bend_deg)[log.record.seen]
    return error - error.mean() if log.is_measured else error


def _reverses(log: GateLog) -> bool:
    steps = np.sign(np.diff(log.record.pull_mm))
    return bool((steps > 0).any() and (steps < 0).any())


def _fitted(logs: list[GateLog], material: GateMaterial) -> float:
    """Return the RMSE that Coleman-Hodgdon leaves on logs, fitted to each [deg]; 0, where none reverses."""
    if not logs:
        return 0.0
    seed = int(material.random(_STREAM).integers(2**31))
    errors = []
    for log in logs:
        record = log.record.pull_mm, log.record.bend_deg
        model, _ = identify_coleman_hodgdon([record], seed, population=40, generations=60)
        errors.append(_error(log, model.response(record[0], float(record[1][0]))))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _of_policy(material: GateMaterial) -> dict[str, Any]:
    """Return the policy's RMSE on each log over all noises [deg]."""
    trials = material.on_logs
    squares = np.concatenate([trial.squares for trial in trials], axis=1).mean(axis=1)
    return {str(name): float(np.sqrt(value)) for name, value in zip(trials[0].units, squares, strict=True)}
