"""The benchmark: every method on the same records under the same noise, scored against the clean truth."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.metrics import confidence_interval, error_indices
from twin.noise import NOISES, draw_noise, noise_variance
from twin.paper import paper_value
from twin.track import Track

Array = NDArray[np.float64]
STEADY_SECONDS = (
    5.0  # left out of `rmse_steady_deg`: the time in which the paper's AM loses the initial error
)

PAPER_CONDITIONS = (
    ("gaussian", 1.0),
    ("gaussian", 5.0),
    ("poisson", 0.1),
    ("poisson", 1.0),
    ("poisson", 2.0),
)
DITHERED_CONDITIONS = (("poisson-dithered", 0.1), ("poisson-dithered", 1.0), ("poisson-dithered", 2.0))
SUITES = {"paper": PAPER_CONDITIONS + DITHERED_CONDITIONS, "paper-only": PAPER_CONDITIONS}


@dataclasses.dataclass(frozen=True)
class Case:
    """What a method is given: one record under B draws of one noise."""

    pull_mm: Array
    """(N,) commanded pulling distance [mm]."""
    measurement_deg: Array
    """(B, N) measured bending angle [deg]."""
    initial_bend_deg: Array
    """(B,) initial estimate, wrong on purpose [deg]."""
    noise_variance: float
    """Variance of the measurement noise, which the filters are told as R [deg^2]."""
    truth_deg: Array | None = None
    """(N,) true angle [deg], given to oracles alone."""


@dataclasses.dataclass(frozen=True)
class Method:
    """An estimator under its name in the tables."""

    name: str
    estimate: Callable[[Case], Array]
    """Returns (B, N) estimated angles [deg]."""
    oracle: bool = False
    """Whether it is shown the truth: such a row is labelled, and no deployable result."""


@dataclasses.dataclass(frozen=True)
class Protocol:
    """How methods are compared; the defaults are the paper's, where it says."""

    suite: str = "paper"
    seeds: int = 20
    """Draws of the noise."""
    sample_time_s: float = 0.1
    initial_error_deg: float = 20.0
    """How far the initial estimate is off."""
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a protocol that cannot run.

        Raises:
            ValueError: the suite is unknown or a number is out of range.
        """
        if self.suite not in SUITES:
            raise ValueError(f"unknown suite {self.suite!r}; valid: {', '.join(SUITES)}")
        if self.seeds < 1:
            raise ValueError(f"seeds = {self.seeds}: must be at least 1")
        if not math.isfinite(self.initial_error_deg):
            raise ValueError(f"initial_error_deg = {self.initial_error_deg}: must be a finite number")
        if not 0 < self.sample_time_s < math.inf:
            raise ValueError(f"sample time {self.sample_time_s} s: must be positive and finite")


def evaluate(
    records: Sequence[tuple[Array, Array]],
    methods: Sequence[Method],
    protocol: Protocol,
    on_progress: Callable[[int, int], None] | None = None,
) -> tuple[list[dict[str, Any]], list[Track]]:
    """Run every method under every noise of the suite.

    The errors of all records are pooled for each noise seed; a row holds means over seeds. The sample at k =
    0, the wrong initial estimate itself, is not scored.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of the test set, at the protocol's sample time.
        methods: estimators, in the order of the table.
        protocol: noises, seeds and initial error.
        on_progress: told how many of how many noises are done.

    Returns:
        Rows of `evaluation.json`, and for each noise the tracks of all methods on the first record and seed.
    """
    conditions = SUITES[protocol.suite]
    rows, tracks = [], []
    for number, (noise, level) in enumerate(conditions):
        errors: dict[str, list[Array]] = {method.name: [] for method in methods}
        for index, (pull, truth) in enumerate(records):
            measurement = truth + _draws(noise, level, index, len(truth), protocol)
            initial = np.full(protocol.seeds, truth[0] + protocol.initial_error_deg)
            case = Case(pull, measurement, initial, noise_variance(noise, level))
            estimates = {}
            for method in methods:
                seen = dataclasses.replace(case, truth_deg=truth) if method.oracle else case
                estimates[method.name] = method.estimate(seen)
                errors[method.name].append(estimates[method.name] - truth)
            if index == 0:
                time = np.arange(len(truth), dtype=float) * protocol.sample_time_s
                first = {name: estimate[0] for name, estimate in estimates.items()}
                tracks.append(Track(noise, level, time, truth, measurement[0], first))
        rows += [_row(noise, level, method, errors[method.name], protocol) for method in methods]
        if on_progress:
            on_progress(number + 1, len(conditions))
    return rows, tracks


def _draws(noise: str, level: float, record: int, samples: int, protocol: Protocol) -> Array:
    """(seeds, N) noise [deg]; each seed has its own stream, whatever their number."""
    kind = list(NOISES).index(noise)
    streams = [
        np.random.default_rng([protocol.seed, seed, record, kind, round(level * 1000)])
        for seed in range(protocol.seeds)
    ]
    return np.stack([draw_noise(noise, level, (samples,), rng) for rng in streams])


def _row(noise: str, level: float, method: Method, errors: list[Array], protocol: Protocol) -> dict[str, Any]:
    """Pool (seeds, N) errors of each record over time, and average the indices over seeds."""
    steady = round(STEADY_SECONDS / protocol.sample_time_s)
    indices = error_indices(np.concatenate([error[:, 1:] for error in errors], axis=1))
    late = error_indices(
        np.concatenate([error[:, min(steady, error.shape[1] - 1) :] for error in errors], axis=1)
    )
    low, high = confidence_interval(indices["rmse_deg"])
    return {
        "noise": noise,
        "level": level,
        "sample_time_s": protocol.sample_time_s,
        "method": method.name,
        "oracle": method.oracle,
        **{name: float(values.mean()) for name, values in indices.items()},
        "rmse_steady_deg": float(late["rmse_deg"].mean()),
        "rmse_ci95_deg": [low, high],
        "seeds": protocol.seeds,
        "paper_rmse_deg": None if method.oracle else paper_value(noise, level, method.name, "rmse_deg"),
    }
