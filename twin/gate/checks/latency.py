"""Latency: the time that the runtime takes for one sample on this machine."""

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.gate.cases import draw_commands, simulate_runs
from twin.gate.material import OTHER_STREAMS, GateMaterial
from twin.gate.result import Check
from twin.live import load_runtime

Array = NDArray[np.float64]
LATENCY = "latency of one sample"
SHARE = 0.1
"""Share of the sample time that one sample may take."""
PERCENTILE = 99
VARIANCE = 0.25  # deg^2
_BUSY = 1.5  # times its processor time: who waits so long waits for others
_WARM_UP = 20  # samples before the clock counts
_STREAM = OTHER_STREAMS + 4


def latency(material: GateMaterial) -> Check:
    """Push samples one by one and time each."""
    rng, T = material.random(_STREAM), material.sample_time
    count = material.size.pushes + _WARM_UP
    pulls, strokes = draw_commands(material.stroke_mm, count * T, T, 1, rng)
    runs = simulate_runs(material.preset, None, pulls[-1:], strokes[-1:], 1, T, rng)
    pull, bend = runs.pull_mm[0], runs.bend_deg[0, 0]
    measured = bend + math.sqrt(VARIANCE) * rng.standard_normal(len(bend))
    live = load_runtime(
        material.path, sample_time=T, noise_variance=VARIANCE, initial_bend_deg=float(bend[0])
    )
    wall, processor = [], []
    for k, sample in enumerate(zip(pull.tolist(), measured.tolist(), strict=True)):
        begin, worked = time.perf_counter(), time.process_time()
        live.push(k * T, *sample)
        wall.append((time.perf_counter() - begin) * 1e3)
        processor.append((time.process_time() - worked) * 1e3)
        if k % 50 == 0:
            material.tell(k / count)
    taken, worked_ms = np.array(wall[_WARM_UP:]), np.array(processor[_WARM_UP:])
    busy = bool(np.median(taken) > _BUSY * max(float(np.median(worked_ms)), 1e-3))
    median, most = (float(np.percentile(worked_ms if busy else taken, of)) for of in (50, PERCENTILE))
    bar = SHARE * T * 1e3
    holds = most <= bar
    notes = ["On this machine: measure again where it is deployed, under its load."]
    if busy:
        notes.append("Other work kept this machine busy: processor time is judged, not time on the clock.")
    return Check(
        LATENCY,
        f"median {median:.2f} ms, {PERCENTILE}th percentile {most:.2f} ms; the sample time is {T * 1e3:g} ms"
        + ("" if holds else ": too slow here, on this machine"),
        figure=most,
        bar=bar,
        unit="ms",
        holds=holds,
        rows=(_row("clock", taken), _row("processor", worked_ms)),
        notes=tuple(notes),
    )


def _row(what: str, taken_ms: Array) -> dict[str, Any]:
    median, most = (float(np.percentile(taken_ms, of)) for of in (50, PERCENTILE))
    return {"time": what, "median_ms": median, "percentile_99_ms": most, "samples": len(taken_ms)}
