"""Honesty of the stated 95 % interval: coverage and NEES of the estimate, NIS of the prediction."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Sensor
from twin.evaluation.innovations import squared_innovations
from twin.evaluation.paper import noise_label
from twin.gate.cases import ZERO_MEAN, draw_commands, noisy, simulate_runs
from twin.gate.material import OTHER_STREAMS, GateMaterial
from twin.gate.result import Check, not_shown
from twin.gate.trial import PairedTrial

Array = NDArray[np.float64]
COVERAGE, NEES, NIS = "coverage of the interval", "NEES of the interval", "NIS of the prediction"
LEAST_COVERAGE = 0.90
"""Share of samples that a 95 % interval must hold at least, under each noise."""
MOST_NEES = 2.0
"""Normalised squares beyond which errors are 1.4 times as large as stated."""
MOST_NIS = 2.0
_STREAM = OTHER_STREAMS + 1
_SETTLING_S = 5.0  # before which a prediction is that of a filter that has seen nothing
_NOT_STATED = "this method states no interval of its own"


def coverage(material: GateMaterial) -> Check:
    """Count how often the stated interval holds the truth, under each noise and on each set of runs."""
    rows = _rows(material, "inside")
    if not rows:
        return not_shown(COVERAGE, _NOT_STATED)
    worst = min(rows, key=lambda row: row["inside"])
    holds = worst["inside"] >= LEAST_COVERAGE
    return Check(
        COVERAGE,
        f"its 95 % interval holds the truth in {worst['inside']:.1%} of the samples or more; "
        f"least on {worst['set']} under {worst['what']}"
        if holds
        else f"its 95 % interval holds the truth in {worst['inside']:.1%} of the samples alone, on "
        f"{worst['set']} under {worst['what']}",
        figure=worst["inside"],
        bar=LEAST_COVERAGE,
        relation="at least",
        unit="share of samples",
        holds=holds,
        rows=rows,
        notes=("Samples of one run are not independent: the share is a mean over runs.",),
    )


def nees(material: GateMaterial) -> Check:
    """Average the square error in units of the variance that the interval states (Bar-Shalom et al. 2001)."""
    rows = _rows(material, "nees")
    if not rows:
        return not_shown(NEES, _NOT_STATED)
    worst = max(rows, key=lambda row: row["nees"])
    holds = worst["nees"] <= MOST_NEES
    return Check(
        NEES,
        f"at most {worst['nees']:.2f}, on {worst['set']} under {worst['what']}; 1 is honest"
        if holds
        else f"errors are {np.sqrt(worst['nees']):.1f} times as large as its interval states, on "
        f"{worst['set']} under {worst['what']}",
        figure=worst["nees"],
        bar=MOST_NEES,
        unit="stated variances",
        holds=holds,
        rows=rows,
    )


def _rows(material: GateMaterial, of: str) -> tuple[dict[str, Any], ...]:
    sets: tuple[tuple[str, Sequence[PairedTrial]], ...] = (
        ("held-out twins", material.held_out),
        ("wider twins", material.wider),
        ("the logs", material.on_logs),
    )
    rows = []
    for name, trials in sets:
        for trial in trials:
            values = getattr(trial, of)
            if values is None:
                return ()
            row = {"set": name, "what": noise_label(*trial.noise), of: float(values.mean())}
            if trial.half_width_deg is not None:
                row["half_width_deg"] = float(trial.half_width_deg.mean())
            rows.append(row)
    return tuple(rows)


def nis(material: GateMaterial) -> Check:
    """Compare innovations with what prediction and sensor together state, under noise without a mean."""
    estimator = material.estimator
    if not estimator.states_interval:
        return not_shown(NIS, _NOT_STATED)
    rng, T = material.random(_STREAM), material.sample_time
    pulls, strokes = draw_commands(material.stroke_mm, material.size.seconds, T, 2, rng)
    runs = simulate_runs(material.preset, material.ranges, pulls, strokes, 2, T, rng)
    rows = []
    for kind, level in ((kind, 0.05 if kind == "salt-and-pepper" else 1.0) for kind in ZERO_MEAN[:3]):
        case = noisy(runs, (kind, level), 1, rng)
        variance = np.asarray(case.sensor.variance)
        squares = squared_innovations(
            estimator.with_sensor(Sensor(variance)),
            case.pull_mm.T,
            case.measurement_deg.T,
            np.asarray(case.initial_bend_deg),
            variance,
            max(round(_SETTLING_S / T), 1),
        )
        rows.append({"what": noise_label(kind, level), "nis": float(np.mean(squares))})
        material.tell(len(rows) / 3)
    worst = max(rows, key=lambda row: float(str(row["nis"])))
    found = float(str(worst["nis"]))
    holds = found <= MOST_NIS
    return Check(
        NIS,
        f"at most {found:.2f}, under {worst['what']}; 1 is honest"
        if holds
        else f"its innovations are {np.sqrt(found):.1f} times as large as prediction and sensor state, under "
        f"{worst['what']}",
        figure=found,
        bar=MOST_NIS,
        unit="stated variances",
        holds=holds,
        rows=tuple(rows),
        notes=("Without a measurement the estimator states its prediction; no noise has a mean here.",),
    )
