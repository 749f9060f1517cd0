"""Behaviour under faults: a stream with planted faults through the very runtime that is deployed."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Sensor
from twin.gate.cases import draw_commands, simulate_runs
from twin.gate.faults import FAULTS, Fault, Sample
from twin.gate.material import OTHER_STREAMS, GateMaterial
from twin.gate.result import Check, none_of
from twin.gate.rival import RIVAL
from twin.live import Alarm, AssuredEstimator, prepare_runtime
from twin.live.online import OnlineEstimator
from twin.live.reading import Health

Array = NDArray[np.float64]
FINITE, FLAGGED, ERRORS = "a number under faults", "planted faults are flagged", "error under faults"
ALLOWED = 1.1
"""Times the error of the fallback alone that an error under faults may be."""
VARIANCE = 0.25  # of the sensor [deg^2]
ALLOWED_DEG = 0.5 * math.sqrt(VARIANCE)
"""Difference that counts as none: half of the deviation of a single measurement [deg]."""
_STREAM = OTHER_STREAMS + 3
_BEFORE_S, _AFTER_S = 15.0, 3.0  # of good samples
_FLAGGED_WITHIN_S = 1.0  # behind a fault: a gap is known when it ends
_TWINS = 3


def no_nan(material: GateMaterial) -> Check:
    """Every estimate, and both ends of every interval, is a number."""
    rows = material.once("faults", _run_all)
    broken = [row["fault"] for row in rows if not row["finite"]]
    return none_of(
        FINITE,
        broken,
        f"every estimate and interval is a number under {len(rows)} kinds of fault",
        f"an estimate is not a number under: {', '.join(broken)}",
        "kinds of fault",
    )


def flagged(material: GateMaterial) -> Check:
    """The runtime says that something is wrong while a fault lasts, or when it ends."""
    rows = material.once("faults", _run_all)
    missed = [row["fault"] for row in rows if row["must_flag"] and row["flagged"] < 1]
    count = sum(row["must_flag"] for row in rows)
    false = float(np.mean([row["flagged_before"] for row in rows]))
    return none_of(
        FLAGGED,
        missed,
        f"each of {count} kinds of planted fault is flagged",
        f"nothing is said of: {', '.join(missed)}",
        "kinds of fault missed",
        rows=[{name: row[name] for name in ("fault", "flagged", "said")} for row in rows],
        notes=(
            f"Of good samples before the faults {false:.1%} are flagged.",
            "A sensor that is some degrees off cannot be told from a good one: it need not be flagged.",
        ),
    )


def errors(material: GateMaterial) -> Check:
    """Errors while a fault lasts, and shortly after, are hardly above those of the trusted filter alone."""
    rows = material.once("faults", _run_all)
    worst = max(rows, key=lambda row: float(row["ratio"]))
    holds = worst["ratio"] <= ALLOWED
    return Check(
        ERRORS,
        f"at most {worst['ratio']:.2f} times that of {RIVAL} alone: {worst['fault']}"
        if holds
        else f"{worst['rmse_deg']:.2f} deg under {worst['fault']}, {RIVAL} alone has "
        f"{worst['fallback_deg']:.2f}",
        figure=float(worst["ratio"]),
        bar=ALLOWED,
        unit="of the fallback's error",
        holds=holds,
        rows=tuple(
            {name: row[name] for name in ("fault", "rmse_deg", "fallback_deg", "ratio")} for row in rows
        ),
        notes=(
            f"During the fault and {_AFTER_S:g} s after; {_TWINS} twins, Gaussian noise, R = {VARIANCE:g}.",
            f"An error up to {ALLOWED_DEG:g} deg above the fallback's, half of the noise, counts as equal.",
        ),
    )


def _run_all(material: GateMaterial) -> list[dict[str, Any]]:
    """Return one row for each kind of fault."""
    rng, T = material.random(_STREAM), material.sample_time
    longest = _BEFORE_S + max(fault.seconds for fault in FAULTS) + _AFTER_S
    pulls, strokes = draw_commands(material.stroke_mm, longest + 2 * T, T, 1, rng)
    runs = simulate_runs(material.preset, material.ranges, pulls, strokes, 1, T, rng)
    streams = []
    for pull, bend in zip(runs.pull_mm, runs.bend_deg[:, 0], strict=True):
        measured = bend + math.sqrt(VARIANCE) * rng.standard_normal(len(bend))
        streams.append((pull, bend, measured, float(bend[0] + rng.uniform(-10, 10))))
    begun = prepare_runtime(material.path, sample_time=T, noise_variance=VARIANCE)
    rows = []
    for number, fault in enumerate(FAULTS):
        found = [_run(material, begun, fault, *stream) for stream in streams[:_TWINS]]
        mine, beside = (np.sqrt(np.mean([of[name] for of in found])) for name in ("square", "fallback"))
        rows.append(
            {
                "fault": fault.name,
                "must_flag": fault.must_flag,
                "finite": all(of["finite"] for of in found),
                "flagged": float(np.mean([of["flagged"] for of in found])),
                "flagged_before": float(np.mean([of["flagged_before"] for of in found])),
                "said": ", ".join(sorted({word for of in found for word in of["said"]})).lower(),
                "rmse_deg": float(mine),
                "fallback_deg": float(beside),
                "ratio": float(mine / beside)
                if mine > beside + ALLOWED_DEG
                else min(float(mine / beside), 1.0),
            }
        )
        material.tell((number + 1) / len(FAULTS))
    return rows


def _run(
    material: GateMaterial,
    begun: Callable[[float], AssuredEstimator],
    fault: Fault,
    pull: Array,
    bend: Array,
    measured: Array,
    initial: float,
) -> dict[str, Any]:
    """Run a runtime that begins at an initial estimate, and the fallback, on one stream with one fault."""
    T = material.sample_time
    good: list[Sample] = [(k * T, float(pull[k]), float(measured[k])) for k in range(len(pull))]
    begin = round(_BEFORE_S / T)
    end = begin + max(round(fault.seconds / T), 2)
    last = min(end + round(_AFTER_S / T), len(good))
    runtime = begun(initial)
    beside = OnlineEstimator(material.rival.with_sensor(Sensor(VARIANCE)), T, initial)
    heard = [*good[:begin], *fault.plant(good[begin:end], good[:begin]), *good[end:last]]
    planted = len(heard) - (last - end) - begin
    squares, others = [], []
    finite, words = True, set[str]()
    before = during = 0
    watched = begin + planted + max(round(_FLAGGED_WITHIN_S / T), 1)
    for number, sample in enumerate(heard):
        reading = runtime.push(*sample)
        other = beside.push(*sample)
        finite &= all(math.isfinite(of) for of in (reading.bend_deg, reading.low_deg, reading.high_deg))
        speaks = [of.name for of in (*Health, *Alarm) if of in _of(reading) and of not in (Alarm.BEGINNING,)]
        if number < begin:
            before += bool(speaks)
        elif number < watched:
            during += bool(speaks)
            words |= {str(name) for name in speaks}
        if number >= begin:
            # The truth now: a sample that comes late is judged by when it comes.
            place = number if number < begin + planted else end + number - planted - begin
            truth = float(bend[min(place, last - 1)])
            squares.append((reading.bend_deg - truth) ** 2)
            others.append((other - truth) ** 2)
    return {
        "finite": finite,
        "flagged": bool(during),
        "flagged_before": before / max(begin, 1),
        "said": words,
        "square": float(np.nan_to_num(np.mean(squares), nan=1e8)),
        "fallback": float(np.mean(others)),
    }


def _of(reading: Any) -> set[Any]:
    """Return the single faults and alarms of a reading."""
    return {*reading.health, *reading.alarms}
