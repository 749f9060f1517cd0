"""First guess of a calibration, from the slopes and ranges of the logs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.measured import LEAST_MOTION, MeasuredLoop
from twin.preset.preset import Preset, parameter_limits

Array = NDArray[np.float64]

FROM_NOTHING = {
    "joint_friction": 1e-3,
    "wire_stiffening": 0.1,
    "pretension": 3.0,
    "sheath_friction": 0.2,
    "sheath_bend_offset": 0.5,
    "sheath_friction_floor": 0.5,
    "section_stiffening": 0.3,
    "routing_friction": 0.05,
    "sheath_friction_growth": 0.5,
    "backlash": 1e-4,
    "wire_slack": 2e-4,
    "servo_gain": 20.0,
    "command_delay": 0.02,
}
"""Values of parameters that the preset has at zero, where a search by logarithm cannot begin."""


def first_guess(base: Preset, loops: Sequence[MeasuredLoop]) -> dict[str, float]:
    """Return first guesses by name, all positive parameters above zero."""
    guess = {name: value for name, value in FROM_NOTHING.items() if getattr(base, name) == 0}
    if len({loop.sheath_bend for loop in loops}) > 2:
        guess["sheath_friction_exponent"] = 2 / 3
    moved = [loop for loop in loops if np.ptp(loop.pull) > LEAST_MOTION] or loops  # a window may stand still
    with_tension = [loop for loop in moved if loop.tension.size]
    loop = max(with_tension or moved, key=lambda loop: np.ptp(loop.bend))  # the least friction of all
    offset, stiffness = _kinematics(loop)
    guess["wire_offset"] = _inside("wire_offset", offset)
    if with_tension:
        at_start = float(np.mean([loop.tension[0].mean() for loop in with_tension]))
        guess["pretension"] = _inside("pretension", max(at_start, 0.1))
        guess["wire_stiffness"] = _inside("wire_stiffness", stiffness)
        moment = np.ptp(loop.tension[:, 0] - loop.tension[:, 1]) * offset
        guess["section_stiffness"] = _inside("section_stiffness", 0.5 * moment / np.ptp(loop.bend))
        guess["joint_friction"] = _inside("joint_friction", max(0.05 * moment, 1e-6))
        guess["sheath_friction_floor"] = 0.1 * guess["pretension"]
    return guess


def _kinematics(loop: MeasuredLoop) -> tuple[float, float]:
    """Return the wires' distance from the axis [m] and their stiffness [N/m], as if nothing rubbed.

    What is pulled bends the section and stretches the wires: pull = r bend + (T_a - T_b) / 2 k. Where load
    cells are missing or contradict, r is that of stiff wires, and k how fast a tension rises (0 without one).
    """
    if loop.tension.size:
        difference = (loop.tension[:, 0] - loop.tension[:, 1]) / 2
        causes = np.stack([loop.bend, difference], axis=1)
        offset, give = np.linalg.lstsq(causes - causes.mean(axis=0), loop.pull - loop.pull.mean())[0]
        if offset > 0 and give > 0:
            return float(offset), float(1 / give)
    stiffness = _slope(loop.tension[:, 0], loop.pull, 0.0) if loop.tension.size else 0.0
    return 1 / _slope(loop.bend, loop.pull, 0.3), stiffness


def _slope(values: Array, pull: Array, least: float) -> float:
    """Return how steeply values (N,) follow a pull where it moves faster than a share of its fastest step.

    A coarse sensor moves in few of these steps: what is left is the ratio of the ranges.
    """
    steps = np.abs(np.diff(pull))
    moving = steps > least * steps.max()
    steepness = float(np.percentile(np.abs(np.diff(values))[moving] / steps[moving], 80))
    return steepness or float(np.ptp(values) / np.ptp(pull))


def _inside(name: str, value: float) -> float:
    low, high = parameter_limits(name)
    return float(np.clip(value, 2 * low, high / 2))
