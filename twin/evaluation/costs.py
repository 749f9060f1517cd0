"""Costs of methods: time of a sample, learned parameters, and time of a training."""

import dataclasses
import statistics
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from twin.episode import Record
from twin.estimation.estimator import Sensor
from twin.estimation.learned.trained_file import learned_parameters, read_trained_file
from twin.evaluation.method import Filtering, Method
from twin.files.run_folder import read_cost

SAMPLES = 200
"""Samples that are timed of a record."""
VARIANCE_DEG2 = 1.0
"""R of the noise that they have [deg^2]."""


@dataclasses.dataclass(frozen=True)
class Cost:
    """Costs of a method: of a sample, and of its training.

    Attributes:
        sample_us: median time of a sample of one stream on one core, as a device waits for it [us]; None for
            what needs a whole record. It is of this process and machine, and no part of what repeats.
        parameters: that were learned; None where nothing is learned, or the file does not say it.
        training_s: processor time of a training, the mean of those that say it [s]; None where none does.
    """

    sample_us: float | None = None
    parameters: int | None = None
    training_s: float | None = None


def method_costs(
    methods: Sequence[Method],
    record: Record,
    files: Mapping[str, Sequence[Path]],
    seed: int = 0,
) -> dict[str, Cost]:
    """Return the costs of each method, by its name.

    Args:
        methods: to run along the record.
        record: of which the first samples are timed.
        files: trained files of those that run on some, by the name of the method.
        seed: of the noise.

    Raises:
        ValueError: the `cost.json` beside a trained file is none.
    """
    noise = np.sqrt(VARIANCE_DEG2) * np.random.default_rng(seed).standard_normal(len(record.time))
    pull, measured = record.pull_mm.tolist(), (record.filled_deg + noise).tolist()
    return {
        method.name: Cost(_microseconds(method, pull, measured), *_learned(files.get(method.name, ())))
        for method in methods
    }


def _learned(files: Sequence[Path]) -> tuple[int | None, float | None]:
    """Return the learned parameters and the mean time of a training [s], as far as the files say it."""
    took = [seconds for path in files if (seconds := read_cost(path.parent)) is not None]
    counted = (learned_parameters(read_trained_file(path)) for path in files)
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
