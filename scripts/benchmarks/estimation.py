"""Kalman filters: valid covariances over a million samples at extreme scales; speed of identification."""

import itertools
import statistics
import time

import numpy as np

from scripts.benchmarks.harness import Array, OnProgress, Result, measurement
from twin.estimation.active_model import ActiveModel, KalmanActiveModel, UnscentedActiveModel
from twin.estimation.gaussian import Belief
from twin.hysteresis import ColemanHodgdon
from twin.identification.models import LOWER, coleman_hodgdon_at, identify_coleman_hodgdon
from twin.identification.search import search
from twin.physics import simulate
from twin.preset.preset import Preset
from twin.signals.excitation import command

FILTERS: tuple[type[ActiveModel], ...] = (KalmanActiveModel, ActiveModel, UnscentedActiveModel)
# Q, R and P may be scaled by one factor without changing the gain: at one Q, R and P span all ratios.
MEASUREMENT_VARIANCES = (1e-12, 1.0, 1e12)
INITIAL_VARIANCES = (1e-12, 1e12)
PERIOD = 1000  # samples that the command repeats
AT_ONCE = 1000  # covariances that are looked at together


@measurement("covariances")
def covariances(steps: int, progress: OnProgress) -> Result:
    """Measure the least 1 - correlation^2 of the covariances of KF, EKF and UKF at extreme Q, R and P."""
    margins = []
    for done, filter_type in enumerate(FILTERS):
        margins.append(least_margin(filter_type, steps))
        progress(done + 1, len(FILTERS))
    names = ", ".join(kind.__name__ for kind in FILTERS)
    name, bar = f"least 1 - correlation^2 over {steps} samples of {names}", "> 0: symmetric and positive"
    return Result(name, min(margins), "", bar)


def least_margin(filter_type: type[ActiveModel], steps: int) -> float:
    """Return the least 1 - correlation^2 of theta and f; minus infinity where a covariance is invalid."""
    settings = np.array(list(itertools.product(MEASUREMENT_VARIANCES, INITIAL_VARIANCES))).T
    active_model = filter_type(ColemanHodgdon(1.15, 22.38, 5.0), 0.1, measurement_variance=settings[0])
    rng = np.random.default_rng(0)
    phase = 2 * np.pi * np.arange(PERIOD) / PERIOD
    pull = 3 + np.sin(phase) + 0.3 * np.sin(7 * phase)
    pull[300:400] = pull[300]  # the command rests
    pulls = np.repeat(pull[:, None], settings.shape[1], axis=1)
    measurements = 60 + rng.standard_normal(pulls.shape)
    belief = active_model.start(pulls[0], np.full(settings.shape[1], 60.0))
    belief = Belief(belief.mean, np.eye(2)[:, :, None] * settings[1], belief.memory)
    least = np.inf
    seen = []
    for k in range(1, steps + 1):
        belief = active_model.step(
            belief, pulls[k % PERIOD], pulls[(k - 1) % PERIOD], measurements[k % PERIOD]
        )
        seen.append(belief.covariance)
        if len(seen) == AT_ONCE or k == steps:
            least = min(least, _margin(np.stack(seen)))
            seen.clear()
    return least


def _margin(covariance: Array) -> float:
    """Return the least 1 - correlation^2 of covariances (N, 2, 2, B)."""
    variance = np.stack([covariance[:, 0, 0], covariance[:, 1, 1]])
    symmetric = np.array_equal(covariance[:, 0, 1], covariance[:, 1, 0])
    if not (np.isfinite(covariance).all() and symmetric and (variance > 0).all()):
        return -np.inf
    return float((1 - covariance[:, 0, 1] / variance[0] * covariance[:, 0, 1] / variance[1]).min())


SECONDS, SAMPLE_TIME = 60.0, 0.1
FINE = 5  # the endoscope is simulated at a fifth of the sample time
NOISE_VARIANCE = 0.1  # R of the record, as in training [deg^2]
POPULATION, GENERATIONS, SEED = 80, 150, 0
REPEATS = 5


@measurement("identification")
def identification(preset: Preset, amplitude: float) -> Result:
    """Measure the identification of a Coleman-Hodgdon model in batches, against one candidate at a time."""
    pull, bend = _record(preset, amplitude)

    def one_at_a_time(unit: Array) -> Array:
        return np.array([_mean_square(coleman_hodgdon_at(point), pull, bend) for point in unit])

    errors, taken = [], []
    for _ in range(REPEATS):
        begin = time.process_time()
        _, rmse = identify_coleman_hodgdon(
            [(pull, bend)], SEED, population=POPULATION, generations=GENERATIONS
        )
        taken.append(time.process_time() - begin)
        errors.append(rmse)
    begin = time.process_time()
    _, mean_square = search(one_at_a_time, len(LOWER), SEED, POPULATION, GENERATIONS)
    slow, fast = time.process_time() - begin, statistics.median(taken)
    same = abs(errors[0] - np.sqrt(mean_square)) <= 1e-3 * errors[0]
    name, bar = "identification of a record of 60 s", "below 1 s, at the same RMSE, 10 times as fast"
    peer, kept = "the same search through the model, one at a time", bool(same and fast < min(1, slow / 10))
    return Result(name, fast, "s of one core", bar, kept, peer, slow)


def _record(preset: Preset, amplitude: float) -> tuple[Array, Array]:
    """Return pull [mm] and noisy angle [deg] of a simulated multi-sine, each (600,): 60 s at T = 0.1 s."""
    rng = np.random.default_rng(SEED)
    pull = command("multi-sine", (-amplitude, amplitude), SECONDS, SAMPLE_TIME / FINE, rng)
    episode = simulate(preset, pull, SAMPLE_TIME / FINE).resampled(SAMPLE_TIME)
    noise = np.sqrt(NOISE_VARIANCE) * rng.standard_normal(len(episode.pull_mm))
    return episode.pull_mm, episode.truth_deg + noise


def _mean_square(model: ColemanHodgdon, pull: Array, bend: Array) -> float:
    """Return the mean square error of one candidate through `ColemanHodgdon.response` [deg^2]."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(
            np.nan_to_num(np.mean((model.response(pull, bend[0]) - bend) ** 2), nan=1e12, posinf=1e12)
        )
