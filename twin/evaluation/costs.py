"""Costs of methods: the time of one sample of one stream, as a device waits for it."""

import statistics
import time
from collections.abc import Sequence

import numpy as np

from twin.estimation.estimator import Sensor
from twin.evaluation.method import Filtering, Method
from twin.evaluation.record import EvaluationRecord

SAMPLES = 200
"""Samples that are timed of a record."""
VARIANCE_DEG2 = 1.0
"""R of the noise that they have [deg^2]."""


def sample_costs(
    methods: Sequence[Method], record: EvaluationRecord, seed: int = 0
) -> dict[str, float | None]:
    """Return the median time of a sample [us] of each method; None for what needs a whole record.

    Times are of this process and machine, one stream on one core; they are no part of what repeats.
    """
    noise = np.sqrt(VARIANCE_DEG2) * np.random.default_rng(seed).standard_normal(len(record.bend_deg))
    pull, measured = record.pull_mm.tolist(), (record.bend_deg + noise).tolist()
    return {method.name: _microseconds(method, pull, measured) for method in methods}


def _microseconds(method: Method, pull: list[float], measured: list[float]) -> float | None:
    if not isinstance(method.estimate, Filtering):
        return None
    form = method.estimate.estimator.with_sensor(Sensor(VARIANCE_DEG2)).single()
    state = form.start(pull[0], measured[0])
    took = []
    for k in range(1, min(SAMPLES, len(pull))):
        begun = time.perf_counter()
        state = form.step(state, pull[k], pull[k - 1], measured[k])
        form.bend_deg(state)
        took.append(time.perf_counter() - begun)
    return 1e6 * statistics.median(took) if took else None
