"""Reduced twin: speed against MuJoCo's, convergence, inverse, start; by processor time."""

import time

import numpy as np

from scripts.benchmarks.harness import (
    Array,
    OnProgress,
    Result,
    in_turn,
    measurement,
    processor_seconds,
    processor_time,
)
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced import ReducedTwins
from twin.signals.excitation import SIGNALS, command
from twin.simulation import simulate_batch

T = 0.1  # sample time [s]
MEMBERS, ONLINE_SAMPLES, INVERSE_BENDS = 32, 600, 2000


@measurement("reduced_speed")
def speed(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure simulated seconds per second of a batch on one thread, against MuJoCo's, at T = 0.1 s."""
    rng = np.random.default_rng(2)
    pulls = [_signal("multi-sine", amplitude, 60.0, rng) for _ in range(16)]
    planar = preset.replace(bending_planes=1)
    rate, peer = _rates([planar] * len(pulls), pulls)
    name, kept = "reduced twin, a batch on one thread", rate >= max(8000, 40 * peer)
    one = Result(
        name, rate, "times real time", ">= 8000, and 40 times MuJoCo", kept, "the twin in MuJoCo", peer
    )
    pulls, lateral = (
        [_signal(kind, amplitude, 30.0, rng) for kind in kinds] for kinds in (SIGNALS, reversed(SIGNALS))
    )
    rate, peer = _rates([preset.replace(bending_planes=2)] * len(pulls), pulls, lateral)
    name = f"{name}, two planes"
    two = Result(name, rate, "times real time", peer="the twin in MuJoCo", peer_value=peer)
    return {"reduced_speed": one, "reduced_speed_planes": two}


def _rates(
    presets: list[Preset], pulls: list[Array], lateral: list[Array] | None = None
) -> tuple[float, float]:
    """Return simulated seconds per second of both twins, the reduced one first."""
    taken = in_turn(
        lambda: simulate_batch(presets, pulls, T, physics="reduced", threads=1, lateral_pulls=lateral),
        lambda: simulate_batch(presets, pulls, T, threads=1, lateral_pulls=lateral),
        repeats=3,
        clock=time.process_time,
    )
    simulated = sum(len(pull) for pull in pulls) * T
    return simulated / taken[0], simulated / taken[1]


@measurement("reduced_online")
def online(preset: Preset, ranges: Ranges, amplitude: float) -> Result:
    """Measure the time of one sample of an ensemble that is advanced sample by sample."""
    rng = np.random.default_rng(3)
    twins = ReducedTwins([ranges.draw(preset, rng) for _ in range(MEMBERS)], T)
    taken = []
    for pull in _signal("multi-sine", amplitude, ONLINE_SAMPLES * T, rng):
        start = time.process_time()
        twins.step(pull)
        taken.append(time.process_time() - start)
    milliseconds = 1e3 * float(np.median(taken))
    return Result(f"reduced twin, a sample of {MEMBERS} members", milliseconds, "ms", "<= 0.3")


@measurement("reduced_draws")
def undecided(preset: Preset, ranges: Ranges, amplitude: float, draws: int, progress: OnProgress) -> Result:
    """Count the random endoscopes that do not find their equilibrium, each driven for 10 s."""
    rng, failed = np.random.default_rng(4), 0
    for start in range(0, draws, 500):
        presets = [ranges.draw(preset, rng) for _ in range(min(500, draws - start))]
        kinds = rng.choice(list(SIGNALS), len(presets))
        pulls = [_signal(kind, amplitude, 10.0, rng) for kind in kinds]
        records = simulate_batch(presets, pulls, T, physics="reduced")
        failed += sum(record is None for record in records)
        progress(start + len(presets), draws)
    name = f"of {draws} random endoscopes, driven for 10 s"
    return Result(name, failed, "without equilibrium", "none", not failed)


@measurement("reduced_inverse")
def inverse(preset: Preset, ranges: Ranges, amplitude: float) -> dict[str, Result]:
    """Measure error and time of the inverse, for bends that wander and that jump within reach.

    The servo has no limits: with them, a jump may take longer than a sample.
    """
    preset = preset.replace(servo_speed=0.0, servo_acceleration=0.0)
    rng, stroke = np.random.default_rng(5), (-amplitude, amplitude)
    errors, taken, missed = [], [], 0
    for place in range(20):
        twins = ReducedTwins([ranges.draw(preset, rng)], T)
        low, high = (twins.inverse(bend, stroke=stroke).bend[0, 0] for bend in (-10.0, 10.0))
        samples = INVERSE_BENDS // 20
        share = np.sin(np.arange(samples) / 6) if place % 2 else rng.uniform(-1, 1, samples)
        for wanted in (low + high) / 2 + 0.4 * (high - low) * share:
            start = time.process_time()
            found = twins.inverse(wanted, stroke=stroke)
            taken.append(time.process_time() - start)
            error = abs(twins.step(found.pull[:, 0])[0] - wanted)
            errors += [error] if found.reached[0] else []
            missed += not found.reached[0]
    worst, milliseconds = np.degrees(max(errors)), 1e3 * float(np.median(taken))
    name = f"inverse, worst of {INVERSE_BENDS - missed} bends reached ({missed} flagged)"
    return {
        "reduced_inverse": Result(name, float(worst), "deg", "<= 0.02"),
        "reduced_inverse_time": Result("inverse, median time", milliseconds, "ms", "< 0.2"),
    }


@measurement("reduced_start")
def start(preset: Preset) -> Result:
    """Measure the processor time of a fresh process until its first sample, against an import of Numba.

    The kernels were compiled before.
    """
    code = (
        "from twin.preset.preset import Preset; from twin.reduced import ReducedTwins\n"
        f"ReducedTwins([Preset(**{preset.to_dict()!r})]).step(1e-3)"
    )
    seconds, peer = in_turn(
        lambda: processor_seconds("-c", code),  # the warm-up compiles
        lambda: processor_seconds("-c", "import numba"),
        repeats=4,
        clock=processor_time,
    )
    name = "reduced twin, start of a process to its first sample, processor time"
    return Result(name, seconds, "s", "< 2.5 times the import", None, "an import of Numba", peer)


def _signal(kind: str, amplitude: float, seconds: float, rng: np.random.Generator) -> Array:
    return command(kind, (-amplitude, amplitude), seconds, T, rng)
