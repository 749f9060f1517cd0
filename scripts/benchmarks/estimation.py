"""Speed of the identification of a model of hysteresis."""

import statistics
import time

import numpy as np

from scripts.benchmarks.harness import Array, Result, measurement
from twin.hysteresis import ColemanHodgdon
from twin.identification.models import LOWER, coleman_hodgdon_at, identify_coleman_hodgdon
from twin.identification.search import search
from twin.physics import simulate
from twin.preset.preset import Preset
from twin.signals.excitation import command

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
