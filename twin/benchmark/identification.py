"""Speed of identification: the genetic algorithm on batches against one candidate at a time.

The search is the same in all: population, generations, seed. Only the cost of a generation is had in another
way. Each uses one core, and the time of that core is taken, so that other work on the machine counts little.
Beside the model's own response, one candidate at a time, stands a loop over plain Python numbers, the
fastest that one candidate gets without a compiler. On a quiet machine a batch of 80 takes 0.6 ms, one
candidate 0.9 ms through the model and 0.05 ms through plain numbers. Most of the time of an identification is
then pymoo's own work on 12 000 individuals: it is about 20 times as fast as through the model, and about
twice as fast as through plain numbers.
"""

import statistics
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.benchmark.result import Result
from twin.hysteresis import ColemanHodgdon
from twin.identification.models import LOWER, coleman_hodgdon_at, identify_coleman_hodgdon
from twin.identification.search import search
from twin.physics import simulate
from twin.preset.preset import Preset
from twin.signals.excitation import command

Array = NDArray[np.float64]

SECONDS, SAMPLE_TIME = 60.0, 0.1
FINE = 5  # the endoscope is simulated at a fifth of the sample time
NOISE_VARIANCE = 0.1
"""Variance R of the noise of the record, as in training [deg^2]."""
POPULATION, GENERATIONS, SEED = 80, 150, 0
REPEATS = 5


def against_one_at_a_time(preset: Preset, amplitude: float) -> Result:
    """Measure the identification of a Coleman-Hodgdon model in batches, against one candidate at a time."""
    return _against(preset, amplitude, _of_model, "the same search through the model, one at a time", 10.0)


def against_plain_numbers(preset: Preset, amplitude: float) -> Result:
    """Measure the same identification against a loop over plain numbers, one candidate at a time."""
    return _against(preset, amplitude, _of_numbers, "the same search in plain Python numbers", None)


def _against(
    preset: Preset,
    amplitude: float,
    cost_of: Callable[[ColemanHodgdon, Array, Array], float],
    peer: str,
    times_faster: float | None,
) -> Result:
    pull, bend = _record(preset, amplitude)

    def one_at_a_time(unit: Array) -> Array:
        return np.array([cost_of(coleman_hodgdon_at(point), pull, bend) for point in unit])

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
    slow = time.process_time() - begin
    fast = statistics.median(taken)
    same = abs(errors[0] - np.sqrt(mean_square)) <= 1e-3 * errors[0]
    holds = same and fast < 1 and (times_faster is None or slow / fast >= times_faster)
    bar = "< 1 s, at the same RMSE" + (f", {times_faster:g} times as fast" if times_faster else "")
    return Result("identification of a record of 60 s", fast, "s of one core", bar, bool(holds), peer, slow)


def _record(preset: Preset, amplitude: float) -> tuple[Array, Array]:
    """Return pull [mm] and noisy angle [deg] of a simulated multi-sine, each (600,): 60 s at T = 0.1 s."""
    rng = np.random.default_rng(SEED)
    pull = command("multi-sine", (-amplitude, amplitude), SECONDS, SAMPLE_TIME / FINE, rng)
    episode = simulate(preset, pull, SAMPLE_TIME / FINE).resampled(SAMPLE_TIME)
    noise = np.sqrt(NOISE_VARIANCE) * rng.standard_normal(len(episode.pull_mm))
    return episode.pull_mm, episode.truth_deg + noise


def _of_model(model: ColemanHodgdon, pull: Array, bend: Array) -> float:
    """Return the mean square error of one candidate through `ColemanHodgdon.response` [deg^2]."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(
            np.nan_to_num(np.mean((model.response(pull, bend[0]) - bend) ** 2), nan=1e12, posinf=1e12)
        )


def _of_numbers(model: ColemanHodgdon, pull: Array, bend: Array) -> float:
    """Return the mean square error of one candidate by eq. 4 over Python floats [deg^2]."""
    a, b, c = float(model.a_per_mm), float(model.b_deg_per_mm), float(model.c_deg_per_mm)  # type: ignore[arg-type]
    angles, commands = bend.tolist(), pull.tolist()
    angle, before, total = angles[0], commands[0], 0.0
    for now, measured in zip(commands[1:], angles[1:], strict=True):
        increment = now - before
        angle += a * abs(increment) * (b * now - angle) + c * increment
        total += (angle - measured) * (angle - measured)
        before = now
    return total / len(angles) if np.isfinite(total) else 1e12
