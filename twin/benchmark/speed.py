"""Speed of the simulation, against a plain MuJoCo chain of the same size in the same run.

What one thread does is timed by its processor time, which others of the machine hardly change.
"""

import statistics
import time
from collections.abc import Callable

from twin.benchmark.result import Result
from twin.benchmark.signals import SAMPLE_TIME, sinusoid
from twin.physics import Endoscope, simulate, simulate_batch
from twin.physics.plain_chain import run_plain_chain
from twin.preset.preset import Preset

REPEATS = 5
PERIOD = 8.0


def one_core(preset: Preset, amplitude: float) -> Result:
    """Measure simulated seconds per second of one endoscope, against a plain chain of the same nv."""
    command = sinusoid(amplitude, PERIOD, 2)
    degrees = Endoscope.from_preset(preset).model.ptr.nv
    ours, theirs = in_turn(
        lambda: simulate(preset, command, SAMPLE_TIME),
        lambda: run_plain_chain(degrees, preset.time_step, 2 * PERIOD),
        clock=time.process_time,
    )
    simulated = 2 * PERIOD + 1  # and the second of rest before a record
    return Result(
        "speed on one core",
        simulated / ours,
        "times real time",
        ">= 100",
        simulated / ours >= 100,
        f"plain MuJoCo chain of nv = {degrees}",
        2 * PERIOD / theirs,
    )


def two_threads(preset: Preset, amplitude: float) -> Result:
    """Measure simulated seconds per second of a batch on two threads, against one."""
    count = 32
    commands = [sinusoid(amplitude, PERIOD, 2)] * count
    two, one = in_turn(
        lambda: simulate_batch([preset] * count, commands, SAMPLE_TIME, threads=2),
        lambda: simulate_batch([preset] * count, commands, SAMPLE_TIME, threads=1),
    )
    simulated = count * (2 * PERIOD + 1)
    return Result(
        "speed of a batch on two threads",
        simulated / two,
        "times real time",
        ">= 1.8 times one thread",
        one / two >= 1.8,
        "the same batch on one thread",
        simulated / one,
    )


def cost_of_vertebrae(preset: Preset, amplitude: float) -> Result:
    """Measure the time of a simulated second with 64 vertebrae, against 8."""
    command = sinusoid(amplitude, 4.0, 1)
    few, many = (preset.replace(vertebrae=n) for n in (8, 64))
    slow, fast = in_turn(
        lambda: simulate(many, command, SAMPLE_TIME),
        lambda: simulate(few, command, SAMPLE_TIME),
        clock=time.process_time,
    )
    return Result(
        "time of 64 vertebrae",
        slow / 5,
        "s per simulated second",
        "<= 8 times that of 8",
        slow / fast <= 8,
        "8 vertebrae",
        fast / 5,
    )


def in_turn(
    first: Callable[[], object],
    second: Callable[[], object],
    repeats: int = REPEATS,
    warm_up: bool = True,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[float, float]:
    """Return the median times [s] of two jobs that take turns, so that noise disturbs both alike."""
    times: tuple[list[float], list[float]] = ([], [])
    for repeat in range(repeats + warm_up):
        for job, taken in zip((first, second), times, strict=True):
            start = clock()
            job()
            if repeat >= warm_up:
                taken.append(clock() - start)
    return statistics.median(times[0]), statistics.median(times[1])
