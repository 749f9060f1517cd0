"""Behaviour on a live stream: planted faults through the runtime that is deployed, and its latency."""

import functools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError
from twin.estimation.estimator import Sensor
from twin.gate.check import SAFETY, Check, declare, none_of
from twin.gate.evidence import OTHER_STREAMS, RIVAL, SPARE, GateMaterial, draw_commands
from twin.live import Alarm, AssuredEstimator, load_runtime, prepare_runtime
from twin.live.assured import REST
from twin.live.online import OnlineEstimator
from twin.live.reading import WRONG_SENSOR, flag_names
from twin.preset.sensor import SensorModel
from twin.reduced import simulate_batch

Array = NDArray[np.float64]
Sample = tuple[float, float, float]  # time [s], pull [mm] and measurement [deg]
Plant = Callable[[Sequence[Sample], Sequence[Sample]], Iterator[Sample]]
"""Yields the samples that replace good ones, given those before them."""
VARIANCE = 0.25  # of a sensor whose noise is not known [deg^2]
ALLOWED = 1.1  # largest error under faults, relative to that of the fallback alone
ALLOWED_DEVIATIONS = 0.5  # of a single measurement: a difference that counts as none
LATENCY_SHARE = 0.1  # share of the sample time that one sample may take
PERCENTILE = 99
SPIKE_DEG, SHIFT_DEG, WRONG_PULL_MM, CLOCK_S = 60.0, 8.0, 5.0, 3600.0
_FAULTS, _LATENCY = OTHER_STREAMS + 3, OTHER_STREAMS + 4
_BEFORE_S, _LONG_BEFORE_S, _AFTER_S = (
    15.0,
    45.0,
    3.0,
)  # of good samples; the second before faults that are slow
WRONG_BY_DEG = 12.0  # measurements of a wrong sensor, where it must be recognised
GAIN, DRIFT_DEG_S, ALTERNATING_DEG, ZERO_DEG = 0.8, 1.0, 0.1, 15.0
KNOCK, KNOCK_S = np.radians(45.0), 0.5  # by which the sheath is bent on, and for how long
LOST, LOST_S = 0.9, 60.0  # share of the pretension that is lost, and for how long
_FLAGGED_WITHIN_S = 1.0  # after a fault: a gap is known when it ends
_TWINS = 3
_BUSY = 1.5  # times its processor time: a longer wait is due to other work
_WARM_UP = 20  # samples before the clock counts


class Fault(NamedTuple):
    """One kind of fault."""

    name: str  # of it
    seconds: float  # that it lasts
    plant: Plant
    # a sensor that is a few degrees off cannot be recognised
    must_flag: bool = True
    of_sensor: bool = False  # recognised by the motion that the command must cause, after a minute of it
    of_endoscope: str = ""  # which change of the endoscope it is, see `_bends`; the sensor is right


def _spikes(good: Sequence[Sample], before: Sequence[Sample]) -> Iterator[Sample]:
    for number, (at, pull, measured) in enumerate(good):
        yield at, pull, measured + (SPIKE_DEG * (1 if number % 8 else -1) if number % 4 == 0 else 0.0)


def _out_of_order(good: Sequence[Sample], before: Sequence[Sample]) -> Iterator[Sample]:
    for number in range(0, len(good) - 1, 2):
        yield good[number + 1]
        yield good[number]
        if number % 3 == 0:
            yield good[number]


def _wrong_pull(good: Sequence[Sample], before: Sequence[Sample]) -> Iterator[Sample]:
    for number, (at, pull, measured) in enumerate(good):
        yield at, pull + (WRONG_PULL_MM if number % 2 else -WRONG_PULL_MM), measured


def _mapped(wrong: Callable[[float, float], float]) -> Plant:
    """Return a fault that makes measurements of the right ones and the time since it began [s]."""
    return lambda good, _: ((at, pull, wrong(measured, at - good[0][0])) for at, pull, measured in good)


def _alternating(good: Sequence[Sample], before: Sequence[Sample]) -> Iterator[Sample]:
    for number, (at, pull, _) in enumerate(good):
        yield at, pull, before[-1][2] + ALTERNATING_DEG * (number % 2)


FAULTS = (
    Fault("no measurement", 3.0, lambda good, _: ((at, pull, math.nan) for at, pull, _y in good)),
    Fault("spikes of the sensor", 3.0, _spikes),
    Fault("stuck sensor", 4.0, lambda good, before: ((at, pull, before[-1][2]) for at, pull, _ in good)),
    Fault("samples late", 1.0, lambda good, before: iter(before[-len(good) :])),
    Fault("samples twice and out of order", 3.0, _out_of_order),
    Fault("gap", 3.0, lambda good, before: iter(())),
    Fault("jump of the clock", 0.5, lambda good, _: ((at - CLOCK_S, pull, y) for at, pull, y in good)),
    Fault("wrong pull", 0.4, _wrong_pull),
    Fault("no pull", 0.5, lambda good, _: ((at, math.nan, y) for at, _pull, y in good)),
    Fault(
        "sensor off by 8 deg",
        3.0,
        lambda good, _: ((at, pull, y + SHIFT_DEG) for at, pull, y in good),
        must_flag=False,
    ),
    Fault("sensor of the wrong sign", 8.0, _mapped(lambda measured, _: -measured), of_sensor=True),
    Fault(f"sensor of gain {GAIN:g}", 8.0, _mapped(lambda measured, _: GAIN * measured), of_sensor=True),
    Fault(
        f"sensor that drifts by {DRIFT_DEG_S:g} deg/s",
        16.0,
        _mapped(lambda measured, seconds: measured + DRIFT_DEG_S * seconds),
        of_sensor=True,
    ),
    Fault("sensor that alternates", 10.0, _alternating, of_sensor=True),
    Fault(
        f"zero off by {ZERO_DEG:g} deg", 8.0, _mapped(lambda measured, _: measured + ZERO_DEG), of_sensor=True
    ),
    Fault("knock on the sheath", 8.0, lambda good, _: iter(good), must_flag=False, of_endoscope="knock"),
    Fault("loss of pretension", LOST_S, lambda good, _: iter(good), must_flag=False, of_endoscope="slack"),
)
"""Kinds of fault, each planted by itself."""


def _variance(material: GateMaterial) -> float:
    """Return R of the sensor [deg^2]: that of the preset, where it states one."""
    return material.sensor.variance_deg2 or VARIANCE


_CALIBRATED = SensorModel(zero_deviation_deg=0.0)  # of simulated streams, as the rival takes it


@declare("a number under faults", SAFETY, "Do not deploy this file; report the fault with gate.json.", 14)
def no_nan(material: GateMaterial) -> Check:
    """No fault of a stream makes an estimate that is not a number."""
    rows = _fault_rows(material)
    broken = [row["fault"] for row in rows if not row["finite"]]
    return none_of(
        broken,
        f"every estimate and interval is a number under {len(rows)} kinds of fault",
        f"an estimate is not a number under: {', '.join(broken)}",
        "kinds of fault",
    )


@declare(
    "planted faults are flagged",
    SAFETY,
    "Calibrate the preset, whose twins check the sensor, or watch for these faults by other means.",
)
def flagged(material: GateMaterial) -> Check:
    """A fault of a stream is noticed."""
    rows = _fault_rows(material)
    missed = [row["fault"] for row in rows if row["must_flag"] and row["flagged"] < 1]
    false = float(np.mean([row["flagged_before"] for row in rows]))
    return none_of(
        missed,
        f"each of {sum(row['must_flag'] for row in rows)} kinds of planted fault is flagged",
        f"not flagged: {', '.join(missed)}",
        "kinds of fault missed",
        rows=tuple({name: row[name] for name in ("fault", "flagged", "after_s", "said")} for row in rows),
        notes=(
            f"Of good samples before the faults {false:.1%} are flagged.",
            "A sensor that is some degrees off, and a change of the endoscope, need not be flagged.",
            f"A sensor that is wrong by {WRONG_BY_DEG:g} deg must be, by the twins that check it.",
        ),
    )


@declare("error under faults", SAFETY, "Prevent these faults, or deploy the tuned filter alone.")
def errors(material: GateMaterial) -> Check:
    """A fault costs no more than it would cost the trusted filter."""
    rows = _fault_rows(material)
    worst = max(rows, key=lambda row: row["ratio"])
    holds = worst["ratio"] <= ALLOWED
    return Check(
        said=f"at most {worst['ratio']:.2f} times that of {RIVAL} alone: {worst['fault']}"
        if holds
        else f"{worst['rmse_deg']:.2f} deg under {worst['fault']}, {RIVAL} alone has "
        f"{worst['fallback_deg']:.2f}",
        figure=worst["ratio"],
        bar=ALLOWED,
        unit="of the fallback's error",
        holds=holds,
        rows=tuple(
            {name: row[name] for name in ("fault", "rmse_deg", "fallback_deg", "ratio")} for row in rows
        ),
        notes=(
            f"During the fault and {_AFTER_S:g} s after; {_TWINS} twins, Gaussian noise of the sensor, "
            f"R = {_variance(material):.3g}.",
            f"An error up to {ALLOWED_DEVIATIONS:g} times the noise above the fallback's counts as equal.",
        ),
    )


@functools.lru_cache(maxsize=1)
def _fault_rows(material: GateMaterial) -> list[dict[str, Any]]:
    """Return one row for each kind of fault; three checks share them."""
    rng, T, variance = material.random(_FAULTS), material.sample_time, _variance(material)
    allowed_deg = ALLOWED_DEVIATIONS * math.sqrt(variance)
    longest = _LONG_BEFORE_S + max(fault.seconds for fault in FAULTS) + _AFTER_S
    pulls, _ = draw_commands(material.stroke_mm, longest + 2 * T, T, 1, rng)
    streams = []
    for pull in pulls[:_TWINS]:
        bends = _bends(material, pull, rng)
        noise = math.sqrt(variance) * rng.standard_normal(len(pull))
        streams.append((pull * 1e3, bends, noise, float(bends[""][0] + rng.uniform(-10, 10))))
    begun = prepare_runtime(
        material.file,
        sample_time=T,
        noise_variance=variance,
        sensor=_CALIBRATED,
        start=REST,
        twins=(material.preset, material.ranges),
    )
    rows = []
    for number, fault in enumerate(FAULTS):
        found = [_run(material, begun, fault, *stream) for stream in streams]
        latest = max(of["after_s"] for of in found)
        mine, alone = (float(np.sqrt(np.mean([of[name] for of in found]))) for name in ("square", "fallback"))
        rows.append(
            {
                "fault": fault.name,
                "must_flag": fault.must_flag,
                "finite": all(of["finite"] for of in found),
                "flagged": float(np.mean([of["flagged"] for of in found])),
                "after_s": None if math.isinf(latest) else latest,
                "flagged_before": float(np.mean([of["flagged_before"] for of in found])),
                "said": ", ".join(sorted({word for of in found for word in of["said"]})).lower(),
                "rmse_deg": mine,
                "fallback_deg": alone,
                "ratio": mine / alone if mine > alone + allowed_deg else min(mine / alone, 1.0),
            }
        )
        material.on_progress((number + 1) / len(FAULTS))
    return rows


def _bends(material: GateMaterial, pull: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Return the angle of one twin along a command [m], and how it would be after changes of it [deg].

    Its sheath is bent on by a knock, or its wires lose pretension: its angle passes to that of an endoscope
    of less pretension.
    """
    T = material.sample_time
    since = np.arange(len(pull)) * T - _LONG_BEFORE_S
    for _ in range(1 + SPARE):
        preset = material.ranges.draw(material.preset, rng)
        knocked = preset.sheath_bend + KNOCK * np.clip(since / KNOCK_S, 0, 1)
        slack = preset.replace(pretension=(1 - LOST) * preset.pretension)
        found = simulate_batch([preset, preset, slack], [pull] * 3, T, sheath_bends=[None, knocked, None])
        plain, after_knock, without = (None if of is None else of.truth_deg for of in found)
        if plain is not None and after_knock is not None and without is not None:
            passed = np.clip(since / LOST_S, 0, 1)
            return {"": plain, "knock": after_knock, "slack": plain + passed * (without - plain)}
    raise DivergedError("twins for the faults of the gate found no equilibrium")


def _run(
    material: GateMaterial,
    begun: Callable[[float], AssuredEstimator],
    fault: Fault,
    pull: Array,
    bends: dict[str, Array],
    noise: Array,
    initial: float,
) -> dict[str, Any]:
    T, bend = material.sample_time, bends[fault.of_endoscope]
    measured = bend + noise
    good: list[Sample] = [(k * T, float(pull[k]), float(measured[k])) for k in range(len(pull))]
    begin = round((_LONG_BEFORE_S if fault.of_sensor or fault.of_endoscope else _BEFORE_S) / T)
    end = begin + max(round(fault.seconds / T), 2)
    last = min(end + round(_AFTER_S / T), len(good))
    runtime = begun(initial)
    alone = OnlineEstimator(material.rival.with_sensor(Sensor(_variance(material))), T, initial)
    planted = [*fault.plant(good[begin:end], good[:begin])]
    back = begin + len(planted)  # number of the first good sample after the fault
    watched = back + max(round(_FLAGGED_WITHIN_S / T), 1)
    squares, others = [], []
    wrong_deg = max(
        (abs(sample[2] - truth) for sample, truth in zip(planted, bend[begin:], strict=False)), default=0
    )
    raised = Alarm.NONE
    finite, words, before, first = True, set[str](), 0, math.inf
    for number, sample in enumerate([*good[:begin], *planted, *good[end:last]]):
        reading, other = runtime.push(*sample), alone.push(*sample)
        finite &= all(math.isfinite(of) for of in (reading.bend_deg, reading.low_deg, reading.high_deg))
        flags = {*flag_names(reading.health), *flag_names(reading.alarms & ~Alarm.BEGINNING)}
        if number < begin:
            before += bool(flags)
            continue
        if number < watched:
            words |= flags
            raised |= reading.alarms & WRONG_SENSOR
            if raised if fault.of_sensor else flags:
                first = min(first, (number - begin) * T)
        # The truth now: a sample that comes late is compared with the truth when it comes.
        truth = float(bend[min(number if number < back else end + number - back, last - 1)])
        squares.append((reading.bend_deg - truth) ** 2)
        others.append((other - truth) ** 2)
    return {
        "finite": finite,
        "flagged": bool(raised) or wrong_deg < WRONG_BY_DEG if fault.of_sensor else bool(words),
        "after_s": first,
        "flagged_before": before / max(begin, 1),
        "said": words,
        "square": float(np.nan_to_num(np.mean(squares), nan=1e8)),
        "fallback": float(np.mean(others)),
    }


@declare("latency of one sample", SAFETY, "Use a longer sample time, or a faster machine.", 3)
def latency(material: GateMaterial) -> Check:
    """An estimate is there long before the next sample."""
    rng, T, variance = material.random(_LATENCY), material.sample_time, _variance(material)
    count = material.size.pushes + _WARM_UP
    records, _ = material.twins(None, rng, seconds=count * T)
    pull, bend = records[-1].pull_mm[0], records[-1].truth_deg[0]
    measured = bend + math.sqrt(variance) * rng.standard_normal(len(bend))
    runtime = load_runtime(
        material.path,
        sample_time=T,
        noise_variance=variance,
        initial_bend_deg=float(bend[0]),
        sensor=_CALIBRATED,
        start=REST,
    )
    clock, processor = [], []
    for k, sample in enumerate(zip(pull.tolist(), measured.tolist(), strict=True)):
        begin, worked = time.perf_counter(), time.process_time()
        runtime.push(k * T, *sample)
        clock.append((time.perf_counter() - begin) * 1e3)
        processor.append((time.process_time() - worked) * 1e3)
        if k % 50 == 0:
            material.on_progress(k / count)
    rows = [_times(*of) for of in (("clock", clock[_WARM_UP:]), ("processor", processor[_WARM_UP:]))]
    busy = rows[0]["median_ms"] > _BUSY * max(rows[1]["median_ms"], 1e-3)
    median, most = rows[busy]["median_ms"], rows[busy]["percentile_99_ms"]
    bar = LATENCY_SHARE * T * 1e3
    notes = ["On this machine: measure again where it is deployed, under its load."]
    if busy:
        notes.append("Other work kept this machine busy: processor time is judged, not time on the clock.")
    return Check(
        said=f"median {median:.2f} ms, {PERCENTILE}th percentile {most:.2f} ms of {T * 1e3:g} ms sample time"
        + ("" if most <= bar else ": too slow here, on this machine"),
        figure=most,
        bar=bar,
        unit="ms",
        holds=most <= bar,
        rows=tuple(rows),
        notes=tuple(notes),
    )


def _times(what: str, taken_ms: list[float]) -> dict[str, Any]:
    median, most = (float(np.percentile(taken_ms, of)) for of in (50, PERCENTILE))
    return {"time": what, "median_ms": median, "percentile_99_ms": most, "samples": len(taken_ms)}
