"""Free parameters of a calibration: selection, and scaling of the search space."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.logs import LEAST_MOTION, MeasuredLoop
from twin.errors import InputError
from twin.preset.preset import Preset, parameter_limits

Array = NDArray[np.float64]

FROM_NOTHING = {
    "joint_friction": 1e-3,
    "wire_stiffening": 0.1,
    "wire_toe": 0.5,
    "pretension": 3.0,
    "sheath_friction": 0.2,
    "sheath_bend_offset": 0.5,
    "sheath_friction_floor": 0.5,
    "section_stiffening": 0.3,
    "routing_friction": 0.05,
    "sheath_friction_growth": 0.5,
    "backlash": 1e-4,
    "wire_slack": 2e-4,
    "servo_gain": 100.0,
    "command_delay": 0.02,
    "sensor_latency": 0.03,
}
"""Values of parameters that the preset has at zero, where a search by logarithm cannot begin."""


SPARED = ("servo_gain", "initial_bend", "lateral_initial_bend", "wire_toe")
"""Parameters that stay as in the preset unless the logs need them: others look like them."""


def first_guess(base: Preset, loops: Sequence[MeasuredLoop]) -> dict[str, float]:
    """Return first guesses by name, all positive parameters above zero."""
    guess = {name: value for name, value in FROM_NOTHING.items() if getattr(base, name) == 0}
    if len({loop.sheath_bend for loop in loops}) > 2:
        guess["sheath_friction_exponent"] = 2 / 3
    moved = [
        loop for loop in loops if np.ptp(loop.episode.pull) > LEAST_MOTION
    ] or loops  # a window may stand still
    with_tension = [loop for loop in moved if loop.tension.size]
    loop = max(with_tension or moved, key=lambda loop: np.ptp(loop.episode.bend))  # the least friction of all
    offset, stiffness = _kinematics(loop)
    guess["wire_offset"] = _inside("wire_offset", offset)
    if with_tension:
        at_start = float(np.mean([loop.tension[0].mean() for loop in with_tension]))
        guess["pretension"] = _inside("pretension", max(at_start, 0.1))
        guess["wire_stiffness"] = _inside("wire_stiffness", stiffness)
        moment = np.ptp(loop.tension[:, 0] - loop.tension[:, 1]) * offset
        guess["section_stiffness"] = _inside("section_stiffness", 0.5 * moment / np.ptp(loop.episode.bend))
        guess["joint_friction"] = _inside("joint_friction", max(0.05 * moment, 1e-6))
        guess["sheath_friction_floor"] = 0.1 * guess["pretension"]
    return guess


def _kinematics(loop: MeasuredLoop) -> tuple[float, float]:
    """Return the wires' distance from the axis [m] and their stiffness [N/m], as if nothing rubbed.

    pull = r bend + (T_a - T_b) / 2 k. Where load cells are missing or contradict, r is that of stiff wires,
    and k how fast a tension rises (0 without one).
    """
    pull, bend = loop.episode.pull, loop.episode.bend
    if loop.tension.size:
        difference = (loop.tension[:, 0] - loop.tension[:, 1]) / 2
        causes = np.stack([bend, difference], axis=1)
        offset, give = np.linalg.lstsq(causes - causes.mean(axis=0), pull - pull.mean())[0]
        if offset > 0 and give > 0:
            return float(offset), float(1 / give)
    stiffness = _slope(loop.tension[:, 0], pull, 0.0) if loop.tension.size else 0.0
    return 1 / _slope(bend, pull, 0.3), stiffness


def _slope(values: Array, pull: Array, least: float) -> float:
    """Return how steeply values (N,) follow a pull where it moves faster than a share of its fastest step.

    Where a coarse sensor rests in most of these steps, it is the ratio of the ranges.
    """
    steps = np.abs(np.diff(pull))
    moving = steps > least * steps.max()
    steepness = float(np.percentile(np.abs(np.diff(values))[moving] / steps[moving], 80))
    return steepness or float(np.ptp(values) / np.ptp(pull))


def _inside(name: str, value: float) -> float:
    low, high = parameter_limits(name)
    return float(np.clip(value, 2 * low, high / 2))


SIGNED = {
    "initial_bend": 0.1,
    "lateral_initial_bend": 0.1,
    "joint_friction_taper": 0.3,
    "friction_warm_up": 0.2,
    "command_zero": 1e-3,
    "lateral_command_zero": 1e-3,
}
"""Step of each parameter that may be negative: it is searched on a linear scale, the others by logarithm."""
_USUALLY = np.log(5.0)  # of a positive parameter from its first guess
_FARTHEST = np.log(100.0)  # a positive parameter is searched up to a factor of 100 from its start


@dataclasses.dataclass(frozen=True)
class FreeParameters:
    """Fitted parameters of a preset and their scaling in the search space."""

    base: Preset  # preset to start from; it gives every other parameter too
    names: tuple[str, ...]  # names of the P fitted parameters

    @property
    def start(self) -> Array:
        """Starting point in the search space, (P,)."""
        return self.encode(self.base)

    @property
    def spread(self) -> Array:
        """Usual distance of a parameter from its first guess in the search space, (P,)."""
        return np.array([1.0 if name in SIGNED else _USUALLY for name in self.names])

    @property
    def lower(self) -> Array:
        """Lower bounds in the search space, (P,)."""
        return self._limits(0)

    @property
    def upper(self) -> Array:
        """Upper bounds in the search space, (P,)."""
        return self._limits(1)

    def encode(self, preset: Preset) -> Array:
        """Return the point (P,) of a preset in the search space."""
        values = [getattr(preset, name) for name in self.names]
        return np.array(
            [v / SIGNED[n] if n in SIGNED else np.log(v) for n, v in zip(self.names, values, strict=True)]
        )

    def decode(self, numbers: Array) -> Preset:
        """Return the preset at a point (P,) of the search space; numbers are clipped to their bounds."""
        values = {}
        for name, number in zip(self.names, np.clip(numbers, self.lower, self.upper), strict=True):
            value = number * SIGNED[name] if name in SIGNED else np.exp(number)
            values[name] = float(np.clip(value, *parameter_limits(name)))  # the exponential rounds
        return self.base.replace(**values)

    def standard_deviation(self, preset: Preset, deviation: Array) -> dict[str, float]:
        """Convert standard deviations (P,) from the search space to the units of the parameters."""
        return {
            name: float(d * (SIGNED[name] if name in SIGNED else getattr(preset, name)))
            for name, d in zip(self.names, deviation, strict=True)
        }

    def without(self, name: str) -> "FreeParameters":
        """Return the parameters without one of them, which stays as the preset to start from had it."""
        base = self.base
        if getattr(base, name) == FROM_NOTHING.get(name):
            base = base.replace(**{name: 0.0})
        return FreeParameters(base, tuple(other for other in self.names if other != name))

    def _limits(self, side: int) -> Array:
        limits, inner = [], (max, min)[side]
        for name, start in zip(self.names, self.start, strict=True):
            limit = parameter_limits(name)[side]
            if name in SIGNED:
                limits.append(limit / SIGNED[name])
            else:
                limits.append(inner(np.log(max(limit, 1e-12)), start + (2 * side - 1) * _FARTHEST))
        return np.array(limits)


def structures(
    base: Preset, loops: Sequence[MeasuredLoop], names: Sequence[str] | None = None
) -> list[FreeParameters]:
    """Return the sets of parameters that logs may be fitted by: of `free_parameters`, and `with_slack`.

    Load cells distinguish slack wires from wound ones, and a user who names parameters has chosen. Without
    them, a search also begins at the preset's own offset of the wires: of elastic wires, the guess from the
    logs is too large.
    """
    free = free_parameters(base, loops, names)
    if names is not None or any(loop.tension.size for loop in loops):
        return [free]
    own = FreeParameters(free.base.replace(wire_offset=base.wire_offset), free.names)
    return [free, own, with_slack(free)]


def free_parameters(
    base: Preset, loops: Sequence[MeasuredLoop], names: Sequence[str] | None = None
) -> FreeParameters:
    """Choose the parameters to fit and guess their starting values from the logs.

    Without load cells the scale of all forces is not in the data: the stiffness of the section then stays and
    sets it. How friction grows with the bend of the sheath needs logs at two bends, its exponent at three;
    with load cells, three bends determine the capstan coefficient first, and the exponent takes a fourth.
    Delays and the lag of the drive are in logs whose times were recorded. Load cells separate a delay of the
    drive, which tensions have too, from the lag of the sensor. Without them their sum is fitted as the lag of
    the sensor or, where the preset states that lag, as the delay of the drive.
    """
    has_tension = any(loop.tension.size for loop in loops)
    timed = any(loop.timed for loop in loops)
    bends = {round(loop.sheath_bend, 6) for loop in loops if loop.sheath_bend is not None}
    if any(loop.episode.lateral_pull.size for loop in loops):
        base = base.replace(bending_planes=2)
    if names is None:
        needs = {
            "section_stiffness": has_tension,
            "wire_toe": has_tension,
            "command_zero": has_tension and any(loop.offset for loop in loops),
            "sheath_friction": has_tension and len(bends) > 2,
            "sheath_friction_growth": len(bends) > 1,
            "sheath_friction_exponent": len(bends) > (3 if has_tension else 2),
            "lateral_initial_bend": base.bending_planes == 2,
            "servo_gain": timed,
            "command_delay": timed and (has_tension or base.sensor_latency > 0),
            "sensor_latency": timed and base.sensor_latency == 0,
        }
        names = [name for name in DEFAULT if needs.get(name, True)]
    for name in names:
        low, _ = parameter_limits(name)
        if name in _NOT_PHYSICAL:
            raise InputError(f"parameter {name!r} cannot be fitted; usual ones: {', '.join(DEFAULT)}")
        if name not in SIGNED and low < 0:
            raise InputError(f"parameter {name!r} may be negative and has no scale to be searched on")
    if len(set(names)) < len(names):
        raise InputError(f"parameters {', '.join(names)}: one is named twice")
    guess = {name: value for name, value in first_guess(base, loops).items() if name in names}
    for name in names:
        if name not in SIGNED and not guess.get(name, getattr(base, name)) > 0:
            raise InputError(f"parameter {name!r} is 0 in the preset: give it a value to start from")
    return FreeParameters(base.replace(**guess), tuple(names))


def with_slack(free: FreeParameters) -> FreeParameters:
    """Return the parameters of wires that are slack about neutral, in place of those that are wound up.

    Then the zero of the command shows, as the middle of a plateau.
    """
    names = [name for name in free.names if name != "pretension"]
    zeros = ("command_zero", "lateral_command_zero")[: free.base.bending_planes]
    return FreeParameters(
        free.base.replace(wire_slack=FROM_NOTHING["wire_slack"]), (*names, "wire_slack", *zeros)
    )


DEFAULT = (
    "section_stiffness",
    "section_stiffening",
    "initial_bend",
    "lateral_initial_bend",
    "joint_friction",
    "joint_friction_taper",
    "wire_offset",
    "routing_friction",
    "wire_stiffness",
    "wire_stiffening",
    "wire_toe",
    "pretension",
    "command_zero",
    "sheath_friction",
    "sheath_friction_floor",
    "sheath_friction_growth",
    "sheath_friction_exponent",
    "servo_gain",
    "command_delay",
    "sensor_latency",
)
"""Parameters that can be identified from loops at several sheath bends with measured tensions."""
_NOT_PHYSICAL = (
    *(field.name for field in dataclasses.fields(Preset) if isinstance(field.default, int)),
    "time_step",
    "control_period",
    "pulley_radius",
    "sheath_bend",
)
