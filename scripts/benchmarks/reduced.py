"""Reduced twin against MuJoCo's: agreement, speed, convergence, inverse, start; by processor time."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from scripts.benchmarks.harness import Array, OnProgress, Result, in_turn, measurement, processor_seconds
from twin.episode import Episode
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced import ReducedTwins
from twin.signals.excitation import SIGNALS, command
from twin.simulation import simulate_batch

T = 0.1  # sample time [s]
SECONDS = 20.0  # length of the records that both twins make; slow commands take twice that
LEAST_RANGE = np.radians(45)  # that a difference is a share of: some drawn endoscopes hardly move [rad]
MEASURES = {
    "rms": "RMS of the bend",
    "largest": "largest difference of the bend",
    "start": "bend before the first motion",
    "tension": "largest difference of a tension",
}
"""Differences of both twins, as shares of the range; before the first motion they stand by themselves.

A section that is curved when nothing pulls it is straight in a new endoscope: it is let go, and how far it
goes until friction holds it depends on MuJoCo's inertia, which follows its step.
"""
FINER, AT_ONCE = 8, 50
MEMBERS, ONLINE_SAMPLES, INVERSE_BENDS = 32, 600, 2000


def records(preset: Preset, ranges: Ranges, amplitude: float, pairs: int) -> tuple[list[Preset], list[Array]]:
    """Return endoscopes and commands [m] to compare both twins on, each along a kind of signal in turn.

    The preset itself follows each kind once, then `pairs` endoscopes that are drawn.
    """
    rng = np.random.default_rng(0)
    kinds = list(SIGNALS)
    presets = [preset] * len(kinds) + [ranges.draw(preset, rng) for _ in range(pairs)]
    return presets, [
        _signal(kinds[place % len(kinds)], amplitude, SECONDS, rng) for place in range(len(presets))
    ]


@measurement("reduced")
def agreement(
    preset: Preset, ranges: Ranges, amplitude: float, pairs: int, progress: OnProgress
) -> dict[str, Result]:
    """Compare both twins along every kind of signal, with a sheath that moves, in two planes, and drawn."""
    presets, pulls = records(preset, ranges, amplitude, pairs)
    of_all = []
    for start in range(0, len(presets), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        of_all += _differences(presets[some], pulls[some])
        progress(min(start + AT_ONCE, len(presets)), len(presets))
    moving = preset.sheath_bend * (1 + 0.8 * np.sin(np.arange(len(pulls[0])) * T / 3))
    of_all += _differences([preset], pulls[:1], sheath_bends=[moving])
    planes = preset.replace(bending_planes=2)
    of_all += _differences([planes], pulls[:1], lateral_pulls=[0.7 * pulls[2]])
    return _agreement("reduced", "default step", of_all, (0.002, 0.01, 0.01, 0.02))


@measurement("reduced_fine")
def fine(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Compare both twins along slow commands, MuJoCo's at an eighth of the step."""
    finer = preset.replace(time_step=preset.time_step / FINER, control_period=preset.control_period / FINER)
    rng = np.random.default_rng(1)
    slow = [_signal(kind, amplitude, 2 * SECONDS, rng) for kind in ("sine", "triangle", "decaying-sine")]
    of_all = _differences([finer] * len(slow), slow)
    return _agreement(
        "reduced_fine", f"1/{FINER} of the step, slow commands", of_all, (0.001, 0.004, 0.004, 0.02)
    )


@measurement("reduced_speed")
def speed(preset: Preset, amplitude: float) -> Result:
    """Measure simulated seconds per second of a batch on one thread, against MuJoCo's, at T = 0.1 s."""
    rng = np.random.default_rng(2)
    pulls = [_signal("multi-sine", amplitude, 60.0, rng) for _ in range(16)]
    presets = [preset] * len(pulls)
    ours, theirs = in_turn(
        lambda: simulate_batch(presets, pulls, T, physics="reduced", threads=1),
        lambda: simulate_batch(presets, pulls, T, threads=1),
        repeats=3,
        clock=time.process_time,
    )
    simulated = sum(len(pull) for pull in pulls) * T
    rate, peer, bar = simulated / ours, simulated / theirs, ">= 8000, and 100 times MuJoCo"
    kept = rate >= max(8000, 100 * peer)
    name = "reduced twin, a batch on one thread"
    return Result(name, rate, "times real time", bar, kept, "MuJoCo twin", peer)


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
    """Measure error and time of the inverse, for bends that wander and that jump within reach."""
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
    """Measure the processor time of a fresh process until its first sample, kernels compiled before."""
    code = (
        "from twin.preset.preset import Preset; from twin.reduced import ReducedTwins\n"
        f"ReducedTwins([Preset(**{preset.to_dict()!r})]).step(1e-3)"
    )
    seconds = min(processor_seconds("-c", code) for _ in range(4))  # the first compiles
    name = "reduced twin, start of a process to its first sample, processor time"
    return Result(name, seconds, "s", "< 0.5")


def _signal(kind: str, amplitude: float, seconds: float, rng: np.random.Generator) -> Array:
    return command(kind, (-amplitude, amplitude), seconds, T, rng)


def _differences(presets: Sequence[Preset], pulls: Sequence[Array], **inputs: Any) -> list[Array]:
    """Return the differences of both twins along each command, in the order of `MEASURES`."""
    records = [
        simulate_batch(presets, pulls, T, physics=physics, **inputs) for physics in ("mujoco", "reduced")
    ]
    return [_difference(*pair) for pair in zip(*records, strict=True)]


def _difference(mujoco: Episode | None, reduced: Episode | None) -> Array:
    if mujoco is None or reduced is None:
        return np.full(len(MEASURES), np.inf)
    away = np.abs(reduced.bend - mujoco.bend) / max(np.ptp(mujoco.bend), LEAST_RANGE)
    tension = np.abs(reduced.wire_tension - mujoco.wire_tension).max(axis=(1, 2))
    tension /= np.ptp(mujoco.wire_tension)
    moving = mujoco.pull != mujoco.pull[0]
    moving[np.argmax(moving) :] = True
    rms = np.sqrt(np.mean(away**2))
    return np.array([rms, away[moving].max(), away[~moving].max(), tension[moving].max()])


def _agreement(name: str, where: str, of_all: Sequence[Array], bars: Sequence[float]) -> dict[str, Result]:
    """Return the worst of all records and the median record as results."""
    results = {}
    for measure, values, bar in zip(MEASURES, np.transpose(of_all), bars, strict=True):
        beyond = f"worst of {len(values)} records, {(values > bar).sum()} beyond the bar"
        of_worst, median = 100 * float(values.max()), 100 * float(np.median(values))
        title, most = f"reduced twin, {where}, {MEASURES[measure]}, {beyond}", f"<= {100 * bar:g} %"
        peer = "the median record"
        results[f"{name}_{measure}"] = Result(title, of_worst, "% of range", most, None, peer, median)
    return results
