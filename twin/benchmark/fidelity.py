"""Error and speed of each named fidelity, against finely divided sheaths at an eighth of the time step."""

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.benchmark.physics import whole
from twin.benchmark.result import Result
from twin.benchmark.signals import SAMPLE_TIME
from twin.benchmark.speed import in_turn
from twin.physics import simulate_batch
from twin.preset.preset import FIDELITIES, Preset, at_fidelity
from twin.signals.excitation import SIGNALS, command

Array = NDArray[np.float64]

SECONDS = 8.0
"""Length of each record [s]."""
REFERENCE = {"sheath_elements": 20, "time_step": 2.5e-3 / 8}
"""Parameters of what every fidelity is compared with."""


def fidelities(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure the error of each fidelity against the stated one, and its speed against `standard`.

    Args:
        preset: the endoscope.
        amplitude: of the commands [m]; half of them pull from there to half of it.
    """
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
        results[f"fidelity_{name}"] = Result(
            f"largest error at fidelity {name}, RMS {rms:.2g}, range {span:.0f} deg",
            most,
            "deg",
            f"<= {stated.most_deg:g} deg, RMS {stated.rms_deg:g} deg",
            most <= stated.most_deg and rms <= stated.rms_deg,
        )
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
    return Result(
        f"speed of a batch at fidelity {name}, one thread",
        simulated / taken,
        "times real time",
        "",
        peer="fidelity standard",
        peer_value=simulated / standard,
    )
