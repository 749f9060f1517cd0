"""A coarse endoscope with every friction, and logs of its loops to calibrate on."""

import dataclasses

import numpy as np

from twin.calibration import MeasuredLoop, measured_loop
from twin.episode import Episode
from twin.physics import simulate
from twin.preset.preset import Preset

SAMPLE_TIME = 0.05  # [s]
SECONDS_PER_CYCLE = 2.5
TRUTH = Preset(
    "truth",
    vertebrae=3,
    section_stiffness=0.025,
    joint_friction=1e-3,
    wire_offset=2e-3,
    wire_stiffness=3e3,
    pretension=5.0,
    sheath_elements=2,
    sheath_friction=0.25,
    sheath_bend=1.0,
    sheath_friction_floor=0.5,
)


def recorded(preset: Preset = TRUTH, cycles: float = 1.3, **changes: float) -> Episode:
    """Its response to a sine."""
    phase = np.arange(0, cycles * SECONDS_PER_CYCLE, SAMPLE_TIME) / SECONDS_PER_CYCLE
    return simulate(preset.replace(**changes), 4e-3 * np.sin(2 * np.pi * phase), SAMPLE_TIME)


def loops(*bends: float) -> list[MeasuredLoop]:
    """One log for each bend of the sheath [rad]."""
    return [measured_loop(recorded(sheath_bend=bend), f"{bend:g} rad", SAMPLE_TIME) for bend in bends]


def changed(log: MeasuredLoop, **arrays: np.ndarray) -> MeasuredLoop:
    """A log with other arrays of its episode; `tension` of wires a and b is (N, 2) or (N, 0)."""
    if (tension := arrays.pop("tension", None)) is not None:
        arrays["wire_tension"] = tension.reshape(len(tension), 2, -1)
    return dataclasses.replace(log, episode=dataclasses.replace(log.episode, **arrays))


def noisy(angle: float, force: float) -> list[MeasuredLoop]:
    """Two logs of the truth whose channels have noise of these deviations [rad, N]."""
    rng = np.random.default_rng(5)
    return [
        changed(
            dataclasses.replace(log, offset=True),
            bend=log.episode.bend + angle * rng.standard_normal(log.episode.bend.shape),
            tension=log.tension + force * rng.standard_normal(log.tension.shape),
        )
        for log in loops(0.0, 1.0)
    ]


def start_of(**changes: float) -> Preset:
    """Where a search starts."""
    return TRUTH.replace(name="start", **changes)
