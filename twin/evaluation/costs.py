"""Costs of methods: time of a sample, learned parameters, and time of a training."""

import dataclasses
import statistics
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from twin.episode import Record
from twin.estimation.estimator import Sensor
from twin.estimation.learned.trained_file import read_trained_file
from twin.evaluation.method import Filtering, Method
from twin.files.run_folder import read_cost

SAMPLES = 200  # samples that are timed of a record
VARIANCE_DEG2 = 1.0  # R of the noise that they have [deg^2]


@dataclasses.dataclass(frozen=True)
class Cost:
    """Costs of a method: of a sample, and of its training."""

    # median time of a sample of one stream on one core, in this process and machine [us]; None for methods
    # that need a complete record
    sample_us: float | None = None
    parameters: int | None = None  # number of learned parameters; None if unknown or none
    training_s: float | None = None  # mean processor time of a training run [s]; None where it is unknown


def method_costs(
    methods: Sequence[Method], record: Record, files: Mapping[str, Sequence[Path]]
) -> dict[str, Cost]:
    """Return the costs of each method along the first samples of a record, by its name.

    `files` are trained files by the name of the method that runs on them.
    """
    noise = np.sqrt(VARIANCE_DEG2) * np.random.default_rng(0).standard_normal(len(record.time))
    pull, measured = record.pull_mm.tolist(), (record.filled_deg + noise).tolist()
    return {
        method.name: Cost(_microseconds(method, pull, measured), *_learned(files.get(method.name, ())))
        for method in methods
    }


def _learned(files: Sequence[Path]) -> tuple[int | None, float | None]:
    """Return the learned parameters and the mean time of a training run [s], as far as they are known."""
    took = [seconds for path in files if (seconds := read_cost(path.parent)) is not None]
    counted = (read_trained_file(path).parameters for path in files)
    parameters = next((count for count in counted if count is not None), None)
    return parameters, statistics.fmean(took) if took else None


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
