"""Physics of the twin against theory, at a size that is too long for tests."""

import statistics
import time
from collections.abc import Sequence

import numpy as np

from scripts.benchmarks.harness import (
    SAMPLE_TIME,
    Array,
    OnProgress,
    Result,
    in_turn,
    measurement,
    random_cycles,
    sinusoid,
)
from twin.calibration.logs import MeasuredLoop
from twin.calibration.parameters import SIGNED, free_parameters
from twin.calibration.search import Fit, calibrate
from twin.calibration.uncertainty import UNKNOWN, uncertainty
from twin.episode import Episode
from twin.errors import DivergedError
from twin.physics import simulate, simulate_batch
from twin.preset.preset import FIDELITIES, Preset, at_fidelity
from twin.preset.randomization import Ranges
from twin.signals.excitation import SIGNALS, command

PERIOD = 8.0
AT_ONCE = 100  # endoscopes in one batch of the long measurements


@measurement("rate_independence")
def rate_independence(preset: Preset, amplitude: float) -> Result:
    """Measure the spread of loop areas at periods of 2, 8 and 32 s."""
    periods = (2.0, PERIOD, 32.0)
    episodes = whole(
        simulate_batch([preset] * 3, [sinusoid(amplitude, period, 2) for period in periods], SAMPLE_TIME)
    )
    areas: list[float] = []
    for episode, period in zip(episodes, periods, strict=True):
        second = slice(round(period / SAMPLE_TIME), None)
        areas.append(abs(float(np.trapezoid(episode.bend[second], episode.pull[second]))))
    spread = (max(areas) - min(areas)) / statistics.mean(areas)
    return _below("loop area at periods of 2, 8, 32 s", 100 * spread, 2.0, "%")


@measurement("hold")
def hold(preset: Preset, amplitude: float) -> Result:
    """Measure the largest drift of a command held for 30 s after stops at full speed, anywhere on a loop."""
    stops = 1 + np.arange(16) / 16
    moving = [sinusoid(amplitude, PERIOD, cycles) for cycles in stops]
    rest = round(30 / SAMPLE_TIME)
    held = [np.concatenate([path, np.full(rest, path[-1])]) for path in moving]
    episodes = whole(simulate_batch([preset] * len(held), held, SAMPLE_TIME))
    drift = max(np.abs(e.bend[-rest - 1 :] - e.bend[-rest - 1]).max() for e in episodes)
    return _below("drift of a command held for 30 s", 100 * drift / _range(episodes), 0.5)


@measurement("time_step")
def time_step(preset: Preset, amplitude: float) -> Result:
    """Measure the largest difference between the default time step and one 8 times smaller."""
    command = [sinusoid(amplitude, PERIOD, 2)]
    coarse, fine = (
        whole(simulate_batch([p], command, SAMPLE_TIME))[0]
        for p in (preset, preset.replace(time_step=preset.time_step / 8))
    )
    off = np.abs(coarse.bend - fine.bend).max()
    return _below("time step against one 8 times smaller", 100 * off / np.ptp(fine.bend), 1.0)


@measurement("capstan")
def capstan(preset: Preset, amplitude: float) -> Result:
    """Measure the worst error of the tension ratio of a sliding wire against exp(-mu phi), phi up to 2 pi."""
    bends = np.linspace(0, 2 * np.pi, 9)
    other = ("sheath_friction_floor", "sheath_friction_growth", "joint_friction", "routing_friction")
    bare = preset.replace(**dict.fromkeys(other, 0.0))
    presets = [bare.replace(sheath_bend=float(bend), sheath_bend_offset=0.0) for bend in bends]
    there, back = np.linspace(0, 2 * amplitude, 201), np.linspace(2 * amplitude, 0.25 * amplitude, 351)
    command = np.concatenate([there, back])
    episodes = whole(simulate_batch(presets, [command] * len(bends), SAMPLE_TIME))
    worst = 0.0
    for episode, bend in zip(episodes, bends, strict=True):
        factor = np.exp(preset.sheath_friction * bend)
        ends = episode.wire_tension[:, 0]
        pulled, released = ends[120:201], ends[-60:]
        worst = max(worst, np.abs(pulled[:, 0] / pulled[:, -1] / factor - 1).max())
        worst = max(worst, np.abs(released[:, -1] / released[:, 0] / factor - 1).max())
    return _below("tension out / in against exp(-mu phi), phi = 0 ... 2 pi", 100 * worst, 2.0, "%")


@measurement("return_point")
def return_point(preset: Preset, amplitude: float) -> Result:
    """Measure the largest trace that a minor loop leaves (Madelung's rules: it closes and is wiped out)."""
    worst, span = 0.0, 0.0
    for low, high in ((-0.25, 0.5), (0.1, 0.9), (-0.75, -0.5), (-0.9, 0.9)):
        before = np.concatenate([sinusoid(amplitude, PERIOD, 1.25), np.linspace(1, low, 300)[1:] * amplitude])
        minor = np.concatenate([np.linspace(low, high, 200)[1:], np.linspace(high, low, 200)[1:]]) * amplitude
        after = np.linspace(low, -1, 200)[1:] * amplitude
        paths = [np.concatenate([before, minor, after]), np.concatenate([before, after])]
        looped, plain = whole(simulate_batch([preset] * 2, paths, SAMPLE_TIME))
        off = looped.bend[len(before) + len(minor) - 1 :] - plain.bend[len(before) - 1 :]
        worst, span = max(worst, np.abs(off).max()), max(span, np.ptp(plain.bend))
    return _below("trace of a minor loop (Madelung)", 100 * worst / span, 0.5)


@measurement("no_friction")
def no_friction(preset: Preset, amplitude: float) -> Result:
    """Measure the width of the loop without dry friction, relative to its range."""
    command = sinusoid(amplitude, PERIOD, 2)
    episode = whole(simulate_batch([preset.without_friction()], [command], SAMPLE_TIME))[0]
    samples = round(PERIOD / SAMPLE_TIME)
    cycle = episode.bend[-samples:]
    mirror = (samples // 2 - 2 - np.arange(samples)) % samples  # sin(phi) = sin(pi - phi): the same pull
    width = np.ptp(cycle - cycle[mirror]) / 2
    return _below("width of the loop without friction", 100 * width / np.ptp(cycle), 0.5)


@measurement("vertebrae")
def vertebrae(preset: Preset, amplitude: float) -> Result:
    """Measure the largest difference between loops of 8, 16, 32 and 64 vertebrae at equal total stiffness."""
    command = [sinusoid(amplitude, PERIOD, 2)]
    presets = [preset.replace(vertebrae=n) for n in (8, 16, 32, 64)]
    bends = [whole(simulate_batch([p], command, SAMPLE_TIME))[0].bend for p in presets]
    return _below("loops of 8, 16, 32, 64 vertebrae", 100 * np.ptp(bends, axis=0).max() / np.ptp(bends), 2.0)


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


def whole(episodes: list[Episode | None]) -> list[Episode]:
    """Return the episodes, all of them complete."""
    whole = [episode for episode in episodes if episode is not None]
    if len(whole) < len(episodes):
        raise DivergedError("a simulation diverged")
    return whole


def _range(episodes: list[Episode]) -> float:
    return max(float(np.ptp(episode.bend)) for episode in episodes)


def _below(name: str, value: float, limit: float, unit: str = "% of range") -> Result:
    return Result(name, float(value), unit, f"< {limit:g} {unit}")


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
    everything = np.ones(len(time), bool)
    loops = []
    for bend in SHEATH_BENDS:
        episode = simulate(truth.replace(sheath_bend=bend), pull, LOG_SAMPLE_TIME)
        angle = episode.bend + OFFSET * rng.standard_normal() + ANGLE_NOISE * rng.standard_normal(len(time))
        noise = FORCE_NOISE * truth.pretension * rng.standard_normal(episode.tension[:, :2].shape)
        loops.append(
            MeasuredLoop(
                name=f"sheath bent by {bend:g} rad",
                sample_time=LOG_SAMPLE_TIME,
                pull=pull,
                bend=angle,
                tension=episode.tension[:, :2] + noise,
                sheath_bend=bend,
                fitted=everything,
                seen=everything,
                offset=True,
                timed=True,
            )
        )
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
