"""Recovery of known endoscopes from logs made in MuJoCo, disturbed, and calibrated as measured ones are."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.benchmark.result import Result
from twin.calibration.logs import MeasuredLoop
from twin.calibration.parameters import SIGNED, free_parameters
from twin.calibration.search import Fit, calibrate
from twin.calibration.uncertainty import UNKNOWN, uncertainty
from twin.physics import simulate
from twin.preset.preset import Preset

Array = NDArray[np.float64]

SAMPLE_TIME, SECONDS, PERIOD = 0.1, 40.0, 20.0  # of each log [s]
SHEATH_BENDS = (0.0, 1.5)  # of the logs of an endoscope [rad]
INNER = 0.6  # amplitude of the second cycle, of the first
ANGLE_NOISE, OFFSET = np.radians(0.1), np.radians(1.5)  # standard deviations [rad]
FORCE_NOISE = 0.003
"""Standard deviation of a load cell's noise, of the pretension."""
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
LEAST = 0.9
"""Share of the parameters that are told which are to be within two of their standard deviations."""


def recovered(
    preset: Preset, amplitude: float, endoscopes: int, progress: Callable[[int, int], None]
) -> dict[str, Result]:
    """Calibrate on logs of endoscopes that are known, and count the parameters that are recovered.

    A parameter counts that the logs tell: its relative standard deviation is within `UNKNOWN`.

    Args:
        preset: what the endoscopes are drawn around, and a calibration begins with.
        amplitude: of the commands [m].
        endoscopes: how many.
        progress: called with those done and their number.
    """
    base = preset.replace(**USUAL)
    away: list[float] = []
    counted = 0
    for seed in range(endoscopes):
        rng = np.random.default_rng([seed, endoscopes])
        truth = drawn(base, rng)
        loops = logs_of(truth, amplitude, rng)
        free = free_parameters(base, loops)
        distances = deviations(calibrate([free], loops, seed=seed), truth)
        away += distances.values()
        counted += len(free.names)
        progress(seed + 1, endoscopes)
    share = float(np.mean(np.array(away) <= 2)) if away else 0.0
    told = f"of {len(away)} parameters that are told of {counted}"
    return {
        "recovery": Result(
            f"known endoscopes ({endoscopes}), share within two standard deviations, {told}",
            100 * share,
            "%",
            f">= {100 * LEAST:.0f} %",
            share >= LEAST,
        ),
        "recovery_median": Result(
            "known endoscopes, median distance of a parameter", float(np.median(away or [np.inf])), "sd", ""
        ),
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
    time = np.arange(0, SECONDS, SAMPLE_TIME)
    pull = amplitude * np.where(time < PERIOD, 1.0, INNER) * np.sin(2 * np.pi * time / PERIOD)
    everything = np.ones(len(time), bool)
    loops = []
    for bend in SHEATH_BENDS:
        episode = simulate(truth.replace(sheath_bend=bend), pull, SAMPLE_TIME)
        angle = episode.bend + OFFSET * rng.standard_normal() + ANGLE_NOISE * rng.standard_normal(len(time))
        noise = FORCE_NOISE * truth.pretension * rng.standard_normal(episode.tension[:, :2].shape)
        loops.append(
            MeasuredLoop(
                name=f"sheath bent by {bend:g} rad",
                sample_time=SAMPLE_TIME,
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
    """Return how far each parameter that is told is from the truth [standard deviations]."""
    free, known = fit.free, uncertainty(fit).deviation
    found, true = free.encode(fit.preset), free.encode(truth)
    away = {}
    for name, here, there in zip(free.names, found, true, strict=True):
        scale = SIGNED[name] if name in SIGNED else getattr(fit.preset, name)
        deviation = known[name] / scale
        if deviation <= UNKNOWN:
            away[name] = abs(here - there) / deviation
    return away
