"""Scaling of an evaluation: time against the number of noise seeds and of samples, which must be linear."""

import time

import numpy as np

from twin.benchmark.result import Result
from twin.episode import Record
from twin.estimation.active_model import ActiveModel, UnscentedActiveModel
from twin.estimation.adaptive import RobustActiveModel
from twin.estimation.open_loop import OpenLoop
from twin.evaluation.compare import compare
from twin.evaluation.method import as_method
from twin.evaluation.protocol import Protocol
from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset

MODEL = ColemanHodgdon(1.15, 22.38, 5.0)
SAMPLE_TIME, SAMPLES, SEEDS, RECORDS = 0.1, 600, 10, 5
LINEAR = 1.15  # twice the work may take this much more than twice the time: clocks are noisy


def cost_of_seeds(preset: Preset, amplitude: float) -> Result:
    """Measure the time of an evaluation with 40 seeds against 20."""
    return _doubled("seeds", amplitude, (2 * SEEDS, SAMPLES), (4 * SEEDS, SAMPLES))


def cost_of_samples(preset: Preset, amplitude: float) -> Result:
    """Measure the time of an evaluation of records of 120 s against 60 s."""
    return _doubled("samples", amplitude, (2 * SEEDS, SAMPLES), (2 * SEEDS, 2 * SAMPLES))


def _doubled(what: str, amplitude: float, one: tuple[int, int], two: tuple[int, int]) -> Result:
    taken = [[_seconds(amplitude, *size) for size in (one, two)] for _ in range(3)]
    first, second = np.min(taken, axis=0)
    return Result(
        f"evaluation with twice the {what}",
        float(second),
        "s",
        f"<= {2 * LINEAR:g} times that with half of them",
        bool(second <= 2 * LINEAR * first),
        peer="half of them",
        peer_value=float(first),
    )


def _seconds(amplitude: float, seeds: int, samples: int) -> float:
    pull = 1e3 * amplitude * np.sin(2 * np.pi * np.arange(samples) * SAMPLE_TIME / 9)
    times = np.arange(samples, dtype=float) * SAMPLE_TIME
    record = Record(times, pull, MODEL.response(pull, 0.0), name="m", source="model")
    kinds: tuple[type[ActiveModel], ...] = (ActiveModel, RobustActiveModel, UnscentedActiveModel)
    methods = [as_method(kind.__name__, kind(MODEL, SAMPLE_TIME)) for kind in kinds]
    methods.append(as_method("static", OpenLoop(MODEL)))
    begin = time.process_time()
    compare([record] * RECORDS, methods, Protocol("full", seeds, SAMPLE_TIME))
    return time.process_time() - begin
