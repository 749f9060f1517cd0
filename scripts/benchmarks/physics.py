"""Physics at a size that is too long for tests: work, divergence, fidelities, known endoscopes."""

import dataclasses
import time
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from scripts.benchmarks.harness import SAMPLE_TIME, Array, OnProgress, Result, in_turn, measurement
from twin.calibration.logs import MeasuredLoop, measured_loop
from twin.calibration.parameters import SIGNED, free_parameters
from twin.calibration.search import Fit, calibrate
from twin.calibration.uncertainty import UNKNOWN, uncertainty
from twin.episode import Episode
from twin.errors import DivergedError
from twin.physics import simulate, simulate_batch
from twin.preset.preset import FIDELITIES, Preset, at_fidelity
from twin.preset.randomization import Ranges
from twin.reduced.simulation import simulate as simulate_reduced
from twin.signals.excitation import SIGNALS, command

PERIOD = 8.0
AT_ONCE = 100  # endoscopes in one batch of the long measurements


def random_cycles(count: int, amplitude: float, period: float, rng: np.random.Generator) -> Array:
    """Return closed cycles of four random harmonics, between 1/8 and all of the amplitude, (count, N) [m].

    The first and the last sample of a cycle are the same.
    """
    phase = np.linspace(0, 2 * np.pi, round(period / SAMPLE_TIME) + 1)
    harmonics = np.arange(1, 5)[:, None, None]
    strengths = rng.normal(size=(4, count, 1)) / harmonics
    phases = rng.uniform(0, 2 * np.pi, (4, count, 1))
    waves = (strengths * np.sin(harmonics * phase + phases)).sum(axis=0)
    sizes = rng.uniform(amplitude / 8, amplitude, (count, 1))
    scaled: Array = waves * sizes / np.abs(waves).max(axis=1, keepdims=True)
    return scaled


@measurement("closed_cycles")
def closed_cycles(preset: Preset, amplitude: float, cycles: int, progress: OnProgress) -> Result:
    """Measure the least work of the drive over random closed cycles, relative to the largest."""
    rng = np.random.default_rng(0)
    waves = random_cycles(cycles, amplitude, PERIOD, rng)
    twice = np.concatenate([waves, waves[:, 1:]], axis=1)
    second = slice(waves.shape[1] - 1, None)
    work: list[float] = []
    for start in range(0, cycles, AT_ONCE):
        some = list(twice[start : start + AT_ONCE])
        for episode in whole(simulate_batch([preset] * len(some), some, SAMPLE_TIME)):
            force = (episode.tension[:, 0] - episode.tension[:, 1])[second]
            work.append(float(np.trapezoid(force, episode.pulley[second])))
        progress(len(work), cycles)
    least = min(work) / max(work)
    name = f"least work over {cycles} random closed cycles"
    return Result(name, least, "of the largest", "never negative", least >= 0)


@measurement("random_draws")
def random_draws(
    preset: Preset, ranges: Ranges, amplitude: float, draws: int, progress: OnProgress
) -> Result:
    """Count the diverging simulations among endoscopes drawn from the ranges, each driven for 10 s."""
    rng = np.random.default_rng(0)
    diverged = 0
    for start in range(0, draws, AT_ONCE):
        some = min(AT_ONCE, draws - start)
        presets = [ranges.draw(preset, rng) for _ in range(some)]
        waves = random_cycles(some, amplitude, 10.0, rng)
        waves -= waves[:, :1]  # from rest
        for episode in simulate_batch(presets, list(waves), SAMPLE_TIME):
            diverged += episode is None or not np.isfinite(episode.wire_tension).all()
        progress(start + some, draws)
    name = f"of {draws} random endoscopes, driven for 10 s"
    return Result(name, diverged, "diverged", "none", not diverged)


def divided(preset: Preset, parts: int) -> Preset:
    """Return a preset with MuJoCo's time step and control period divided."""
    return preset.replace(time_step=preset.time_step / parts, control_period=preset.control_period / parts)


def whole(episodes: list[Episode | None]) -> list[Episode]:
    """Return the episodes, all of them complete."""
    whole = [episode for episode in episodes if episode is not None]
    if len(whole) < len(episodes):
        raise DivergedError("a simulation diverged")
    return whole


SECONDS = 8.0  # length of each record
REFERENCE = {"sheath_elements": 20, "time_step": 2.5e-3 / 8}
"""Parameters of what every fidelity is compared with."""


@measurement("fidelities")
def fidelities(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure the error of each fidelity against the stated one, and its speed against `standard`."""
    commands = [
        command(signal, (low, amplitude), SECONDS, SAMPLE_TIME, np.random.default_rng(number))
        for low in (-amplitude, amplitude / 2)
        for number, signal in enumerate(SIGNALS)
    ]
    reference = bends_of(preset.replace(**REFERENCE), commands)
    span = max(float(np.degrees(np.ptp(bend))) for bend in reference)
    results = {}
    for name, stated in FIDELITIES.items():
        divided = at_fidelity(preset, name)
        rms, most = errors_deg(bends_of(divided, commands), reference)
        title = f"largest error at fidelity {name}, RMS {rms:.2g}, range {span:.0f} deg"
        bar = f"<= {stated.most_deg:g} deg, RMS {stated.rms_deg:g} deg"
        kept = most <= stated.most_deg and rms <= stated.rms_deg
        results[f"fidelity_{name}"] = Result(title, most, "deg", bar, kept)
        results[f"fidelity_{name}_speed"] = _speed(name, preset, commands)
    return results


def bends_of(preset: Preset, commands: Sequence[Array]) -> list[Array]:
    """Simulate records and return their bends, (N,) each [rad]."""
    batch = simulate_batch([preset] * len(commands), commands, SAMPLE_TIME, threads=1)
    return [episode.bend for episode in whole(batch)]


def errors_deg(bends: Sequence[Array], reference: Sequence[Array]) -> tuple[float, float]:
    """Return the largest RMS error of a record and the largest error at any time [deg]."""
    off = [np.degrees(bend - near) for bend, near in zip(bends, reference, strict=True)]
    return max(float(np.sqrt(np.mean(o**2))) for o in off), max(float(np.abs(o).max()) for o in off)


def _speed(name: str, preset: Preset, commands: Sequence[Array]) -> Result:
    divided, simulated = at_fidelity(preset, name), SECONDS * len(commands)
    taken, standard = in_turn(
        lambda: bends_of(divided, commands), lambda: bends_of(preset, commands), 3, clock=time.process_time
    )
    name, peer = f"speed of a batch at fidelity {name}, one thread", "fidelity standard"
    return Result(name, simulated / taken, "times real time", "", None, peer, simulated / standard)


SHARES = (0.2, 0.6, 1.0)  # of the amplitude that steps go to
LEAST_BEND = np.radians(1.0)  # range of a tip that moves [rad]
SERVOS = {
    "as in the preset": {},
    "without limits": {"servo_speed": 0.0, "servo_acceleration": 0.0},
    "20 mm a second": {"servo_speed": 0.02, "servo_acceleration": 0.0},
}
"""Limits of the servo that steps are measured with."""


@measurement("steps")
def steps(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure along step commands how far both twins are from finer ones, and from each other."""
    found = {}
    for servo, limits in SERVOS.items():
        for rise in (1, 5):
            errors = [_step_errors(preset.replace(**limits), share * amplitude, rise) for share in SHARES]
            for name, column, bar in (("16 times finer", 0, "<= 1 %"), ("the reduced twin", 1, "")):
                of_shares = ", ".join(f"{error[column]:.2f}" for error in errors)
                title = (
                    f"steps within {rise * SAMPLE_TIME:g} s, {servo}: off from {name} by {of_shares}, most"
                )
                most = max(error[column] for error in errors)
                key = f"steps {servo} {rise} {name}".replace(" ", "_")
                found[key] = Result(title, most, "% of the range, RMS", bar)
    return found


def _step_errors(preset: Preset, amplitude: float, rise: int) -> tuple[float, float]:
    """Return the RMS distance from a twin with 1/16 of time step and period, and from the reduced one [%].

    The command goes to twelve random levels within an amplitude [m], each within `rise` samples.
    """
    levels = amplitude * np.concatenate([[0.0], np.random.default_rng(0).uniform(-1, 1, 12)])
    held = [np.concatenate([np.linspace(a, b, rise + 1)[1:], np.full(20, b)]) for a, b in pairwise(levels)]
    pull = np.concatenate([[0.0], *held])
    finer = divided(preset, 16)
    bend = simulate(preset, pull, SAMPLE_TIME).bend
    references = simulate(finer, pull, SAMPLE_TIME).bend, simulate_reduced(preset, pull, SAMPLE_TIME).bend
    spans = [max(float(np.ptp(other)), LEAST_BEND) for other in references]
    fine, reduced = (
        100 * float(np.sqrt(np.mean((bend - other) ** 2))) / span
        for other, span in zip(references, spans, strict=True)
    )
    return fine, reduced


LOG_SAMPLE_TIME, LOG_SECONDS, LOG_PERIOD = 0.1, 40.0, 20.0  # of each log [s]
SHEATH_BENDS = (0.0, 1.5)  # of the logs of an endoscope [rad]
INNER = 0.6  # amplitude of the second cycle, of the first
ANGLE_NOISE, OFFSET = np.radians(0.1), np.radians(1.5)  # standard deviations [rad]
FORCE_NOISE = 0.003  # standard deviation of a load cell, of the pretension
DELAYS = (0.02, 0.3)  # of the drive [s]
SPREAD = {
    "section_stiffness": 0.25,
    "section_stiffening": 0.4,
    "initial_bend": 0.1,
    "joint_friction": 0.4,
    "joint_friction_taper": 0.1,
    "wire_offset": 0.1,
    "routing_friction": 0.4,
    "wire_stiffness": 0.3,
    "wire_stiffening": 0.3,
    "pretension": 0.2,
    "sheath_friction_floor": 0.4,
    "sheath_friction_growth": 0.3,
    "servo_gain": 0.4,
}
"""Standard deviation of each parameter: of its logarithm, or of its value where it may be negative."""
USUAL = {"section_stiffening": 0.1, "servo_gain": 20.0, "initial_bend": 0.0, "joint_friction_taper": 0.25}
"""Middle of the draws where it is not the preset's own value."""


@measurement("recovery")
def recovered(preset: Preset, amplitude: float, known: int, progress: OnProgress) -> dict[str, Result]:
    """Calibrate on logs of endoscopes that are known, and count the parameters that are recovered.

    A parameter counts if the logs determine it: its relative standard deviation is within `UNKNOWN`.
    """
    base = preset.replace(**USUAL)
    away: list[float] = []
    counted = 0
    for seed in range(known):
        rng = np.random.default_rng([seed, known])
        truth = drawn(base, rng)
        loops = logs_of(truth, amplitude, rng)
        free = free_parameters(base, loops)
        distances = deviations(calibrate([free], loops, seed=seed), truth)
        away += distances.values()
        counted += len(free.names)
        progress(seed + 1, known)
    share = float(np.mean(np.array(away) <= 2)) if away else 0.0
    which = f"of {len(away)} determined parameters of {counted}"
    name = f"known endoscopes ({known}), share within two standard deviations, {which}"
    median = float(np.median(away or [np.inf]))
    return {
        "recovery": Result(name, 100 * share, "%", ">= 90 %"),
        "recovery_median": Result("known endoscopes, median distance of a parameter", median, "sd"),
    }


def drawn(base: Preset, rng: np.random.Generator) -> Preset:
    """Return an endoscope drawn around a preset."""
    changes = {}
    for name, spread in SPREAD.items():
        step = spread * rng.standard_normal()
        value = getattr(base, name)
        changes[name] = value + step if name in SIGNED else value * float(np.exp(step))
    return base.replace(**changes, command_delay=float(rng.uniform(*DELAYS)))


def logs_of(truth: Preset, amplitude: float, rng: np.random.Generator) -> list[MeasuredLoop]:
    """Return a noisy log at each bend of the sheath, with tensions, its angle with an offset."""
    time = np.arange(0, LOG_SECONDS, LOG_SAMPLE_TIME)
    pull = amplitude * np.where(time < LOG_PERIOD, 1.0, INNER) * np.sin(2 * np.pi * time / LOG_PERIOD)
    loops = []
    for bend in SHEATH_BENDS:
        episode = simulate(truth.replace(sheath_bend=bend), pull, LOG_SAMPLE_TIME)
        angle = episode.bend + OFFSET * rng.standard_normal() + ANGLE_NOISE * rng.standard_normal(len(time))
        noise = FORCE_NOISE * truth.pretension * rng.standard_normal((len(time), 2))
        log = dataclasses.replace(
            episode,
            measured_bend=angle,
            wire_tension=(episode.tension[:, :2] + noise)[..., None],
            metadata={"source": "measured"},
        )
        loops.append(measured_loop(log, f"sheath bent by {bend:g} rad", LOG_SAMPLE_TIME))
    return loops


def deviations(fit: Fit, truth: Preset) -> dict[str, float]:
    """Return how far each determined parameter is from the truth [standard deviations]."""
    free, known = fit.free, uncertainty(fit).deviation
    found, true = free.encode(fit.preset), free.encode(truth)
    away = {}
    for name, here, there in zip(free.names, found, true, strict=True):
        scale = SIGNED[name] if name in SIGNED else getattr(fit.preset, name)
        deviation = known[name] / scale
        if deviation <= UNKNOWN:
            away[name] = abs(here - there) / deviation
    return away
