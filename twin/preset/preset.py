"""Physical parameters of one endoscope: a frozen dataclass, read from a YAML preset and checked."""

import dataclasses
import difflib
import math
from collections.abc import Mapping, Sequence
from typing import Any

from twin.errors import InputError
from twin.files.bounds import LONGEST_NAME, check_name
from twin.files.shown import cut, shown


def _within(default: float, low: float, high: float) -> Any:
    """Return a field with a default and physical limits."""
    return dataclasses.field(default=default, metadata={"low": low, "high": high})


@dataclasses.dataclass(frozen=True)
class Preset:
    """Tendon-driven endoscope: one or two bending planes with two antagonistic wires each. SI units.

    Attributes:
        name: name of the endoscope.
        bending_planes: 1 has two wires (a, b); 2 has four (c and d bend the section sideways).
        wires_per_plane: 2 has antagonistic wires; 1 has wires a and c alone, and the section's own stiffness
            brings it back. A wire that is alone is not wound up.
        vertebrae: number of rigid links of the bending section, each on a hinge (on two crossed hinges with
            two planes).
        section_length: length of the bending section [m].
        section_mass: mass of the bending section [kg].
        section_stiffness: bending stiffness of the whole section [N m / rad]; one hinge is `vertebrae` times
            as stiff.
        section_stiffening: growth of the stiffness with the bend, counted from `initial_bend` [1 / rad^2]:
            moment = section_stiffness * bend * (1 + section_stiffening * bend^2).
        section_damping: viscous damping of the whole section [N m s / rad].
        initial_bend: bend of the section when no wire pulls [rad].
        lateral_initial_bend: the same in the plane of wires c and d [rad].
        joint_friction: mean dry friction torque of one hinge [N m]; independent of `vertebrae`, as hinges
            act in series.
        joint_friction_taper: taper of the hinge friction [-]: from (1 + taper) times the mean at the base to
            (1 - taper) times at the tip.
        wire_offset: distance of each wire from the neutral axis, its moment arm at every hinge [m].
        routing_friction: friction coefficient between the wires and the vertebrae that guide them [-].
        wire_stiffness: axial stiffness E A / length of one whole wire, pulley to tip, at zero tension
            [N / m].
        wire_stiffening: relative growth of the wire stiffness with tension, at zero tension [1 / N]: strands
            and liner settle.
        wire_damping: internal damping of one whole wire against its stretch rate [N s / m].
        pretension: tension that the wires are wound up to, at the pulley [N]; friction leaves less at the
            tip. Wires with slack have none.
        wire_slack: length by which each wire is too long to be taut in a new, straight endoscope [m].
        sheath_length: length of the sheath between pulley and bending section [m]; only drawn, as
            `wire_stiffness` is that of the whole wire.
        sheath_elements: number of friction elements along the sheath of each wire.
        sheath_friction: friction coefficient mu between wire and sheath, of the capstan equation [-].
        sheath_bend: bend angle phi of the sheath [rad]; a run may give its own.
        sheath_bend_offset: wrap angle of the wires in a straight sheath, by bends inside the housing [rad].
        sheath_friction_floor: friction of one wire in the whole sheath that does not depend on its tension,
            in a straight sheath [N].
        sheath_friction_growth: what a sheath bent by one radian adds to that [N].
        sheath_friction_exponent: exponent p of that growth [-]: growth * bend^p.
        friction_warm_up: relative excess of the sheath friction at the start of a run [-]; it decays
            exponentially.
        warm_up_time: time constant of that decay [s].
        friction_wear: relative growth of the sheath friction per distance travelled by the pulley [1 / m].
        stiction: share by which the sheath's friction at rest exceeds that of sliding [-]; every other
            friction is that of sliding. The tip then moves in steps.
        pulley_radius: radius of the driving pulley [m]; it converts a pulley angle to a pulling distance.
        command_zero: command at which the endoscope is neutral [m]; the pulley is at command less zero.
        lateral_command_zero: the same of wires c and d [m].
        command_delay: time after which the motor follows a command [s].
        backlash: play between motor and pulley, as a distance at the pulley [m].
        servo_gain: proportional gain of the motor's position loop [1 / s]; 0 follows without lag.
        servo_speed: speed limit of the motor, as pulling speed [m / s]; 0 is none.
        servo_acceleration: acceleration limit of the motor [m / s^2]; 0 is none.
        encoder_counts: counts per turn of the motor encoder that closes the position loop; 0 is continuous.
        sensor_period: time between two readings, which are held in between [s]; 0 reads every sample.
        sensor_latency: delay between the measurement of a reading and its arrival [s].
        sensor_resolution: quantisation step of a reading [rad]; 0 is none.
        sensor_noise: standard deviation of the Gaussian noise of a reading [rad].
        gravity_x: gravity along the shaft, towards the tip [m / s^2].
        gravity_y: gravity across the plane of wires a and b [m / s^2].
        gravity_z: gravity in the plane of wires a and b, towards wire a [m / s^2].
        time_step: time step of the physics [s].
        control_period: time between two updates of the command and of the load-dependent friction [s].
    """

    name: str

    # The bending section.
    bending_planes: int = _within(1, 1, 2)
    wires_per_plane: int = _within(2, 1, 2)
    vertebrae: int = _within(16, 1, 128)
    section_length: float = _within(0.04, 1e-3, 2.0)
    section_mass: float = _within(2e-4, 1e-9, 10.0)
    section_stiffness: float = _within(0.05, 1e-6, 1e3)
    section_stiffening: float = _within(0.0, 0.0, 20.0)
    section_damping: float = _within(3e-5, 0.0, 10.0)
    initial_bend: float = _within(0.0, -math.pi, math.pi)
    lateral_initial_bend: float = _within(0.0, -math.pi, math.pi)
    joint_friction: float = _within(1e-3, 0.0, 10.0)
    joint_friction_taper: float = _within(0.0, -1.0, 1.0)
    wire_offset: float = _within(1.3e-3, 1e-4, 0.1)
    routing_friction: float = _within(0.0, 0.0, 2.0)

    # The wires.
    wire_stiffness: float = _within(8e3, 10.0, 1e6)
    wire_stiffening: float = _within(0.0, 0.0, 10.0)
    wire_damping: float = _within(3.0, 0.0, 1e5)
    pretension: float = _within(3.0, 0.0, 500.0)
    wire_slack: float = _within(0.0, 0.0, 0.02)

    # The sheath.
    sheath_length: float = _within(0.6, 1e-3, 10.0)
    sheath_elements: int = _within(5, 1, 64)
    sheath_friction: float = _within(0.3, 0.0, 2.0)
    sheath_bend: float = _within(math.pi, 0.0, 8 * math.pi)
    sheath_bend_offset: float = _within(0.0, 0.0, 8 * math.pi)
    sheath_friction_floor: float = _within(0.1, 0.0, 100.0)
    sheath_friction_growth: float = _within(0.0, 0.0, 100.0)
    sheath_friction_exponent: float = _within(1.0, 0.1, 4.0)
    friction_warm_up: float = _within(0.0, -0.9, 5.0)
    warm_up_time: float = _within(60.0, 1e-2, 1e6)
    friction_wear: float = _within(0.0, 0.0, 100.0)
    stiction: float = _within(0.0, 0.0, 5.0)

    # The drive.
    pulley_radius: float = _within(0.01, 1e-4, 1.0)
    command_zero: float = _within(0.0, -0.1, 0.1)
    lateral_command_zero: float = _within(0.0, -0.1, 0.1)
    command_delay: float = _within(0.0, 0.0, 0.5)
    backlash: float = _within(0.0, 0.0, 0.01)
    servo_gain: float = _within(0.0, 0.0, 1e3)
    servo_speed: float = _within(0.0, 0.0, 10.0)
    servo_acceleration: float = _within(0.0, 0.0, 1e3)
    encoder_counts: int = _within(0, 0, 2**24)

    # The sensor of the bending angle.
    sensor_period: float = _within(0.0, 0.0, 10.0)
    sensor_latency: float = _within(0.0, 0.0, 10.0)
    sensor_resolution: float = _within(0.0, 0.0, 1.0)
    sensor_noise: float = _within(0.0, 0.0, 1.0)

    # The world.
    gravity_x: float = _within(0.0, -100.0, 100.0)
    gravity_y: float = _within(0.0, -100.0, 100.0)
    gravity_z: float = _within(0.0, -100.0, 100.0)
    time_step: float = _within(2.5e-3, 1e-6, 0.02)
    control_period: float = _within(1e-2, 1e-6, 0.1)

    def __post_init__(self) -> None:
        """Check every parameter against its physical limits."""
        check_name("preset parameter name", self.name)
        for field in dataclasses.fields(self)[1:]:
            value = getattr(self, field.name)
            _check(field, value)
            if isinstance(field.default, float):  # 3 and 3.0 are one preset, and are written alike
                object.__setattr__(self, field.name, float(value))
        steps = self.control_period / self.time_step
        if steps < 1 or abs(steps - round(steps)) > 1e-9:
            raise InputError(
                f"preset parameter control_period = {self.control_period!r}: "
                f"must be a whole multiple of time_step = {self.time_step!r}"
            )

    @property
    def wires(self) -> int:
        """Number of wires in a record: two for each bending plane, whether there are two or not."""
        return 2 * self.bending_planes

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Gravity along x, y, z [m / s^2]."""
        return self.gravity_x, self.gravity_y, self.gravity_z

    def replace(self, **changes: Any) -> "Preset":
        """Return a copy with some parameters changed."""
        names = [field.name for field in dataclasses.fields(self)]
        for name in changes:
            if name not in names:
                raise InputError(f"unknown preset parameter {shown(name)}{suggestion(name, names)}")
        return dataclasses.replace(self, **changes)

    def without_friction(self) -> "Preset":
        """Return the same endoscope with every dry friction set to zero."""
        return self.replace(
            sheath_friction=0.0,
            sheath_friction_floor=0.0,
            sheath_friction_growth=0.0,
            joint_friction=0.0,
            routing_friction=0.0,
        )

    @property
    def command_zeros(self) -> tuple[float, ...]:
        """Command of each bending plane at which the endoscope is neutral [m]."""
        return (self.command_zero, self.lateral_command_zero)[: self.bending_planes]

    @property
    def initial_bends(self) -> tuple[float, ...]:
        """Bend of the section in each bending plane when no wire pulls [rad]."""
        return (self.initial_bend, self.lateral_initial_bend)[: self.bending_planes]

    def without_viscosity(self) -> "Preset":
        """Return the same endoscope with every viscous term set to zero."""
        return self.replace(section_damping=0.0, wire_damping=0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters by name, as in a preset file."""
        return dataclasses.asdict(self)


def parameter_limits(name: str) -> tuple[float, float]:
    """Return the lowest and the highest value of a parameter."""
    limits = {field.name: field.metadata for field in dataclasses.fields(Preset)[1:]}
    if name not in limits:
        raise InputError(f"unknown preset parameter {shown(name)}{suggestion(name, list(limits))}")
    return limits[name]["low"], limits[name]["high"]


def parse_changes(changes: Sequence[str]) -> dict[str, Any]:
    """Parse words such as `pretension=4` into parameters by name."""
    whole = {field.name for field in dataclasses.fields(Preset) if isinstance(field.default, int)}
    parsed = {}
    for change in changes:
        name, _, text = change.partition("=")
        try:
            parsed[name] = int(text) if name in whole else float(text)
        except ValueError as error:
            rule = (
                "a whole number is needed"
                if name in whole
                else "must be NAME=VALUE, as in wire_stiffness=2e4"
            )
            raise InputError(f"change of the preset {shown(change)}: {rule}") from error
    return parsed


def _check(field: "dataclasses.Field[Any]", value: Any) -> None:
    low, high = field.metadata["low"], field.metadata["high"]
    stated = f"preset parameter {field.name} = {shown(value)}"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e300:
        raise InputError(f"{stated}: must be a finite number")
    if isinstance(field.default, int) and (not isinstance(value, int) or not low <= value <= high):
        raise InputError(f"{stated}: must be a whole number from {low} to {high}")
    if value <= 0 and low > 0:
        raise InputError(f"{stated}: must be positive")
    if value < 0 and low == 0:
        raise InputError(f"{stated}: must not be negative")
    if not low <= value <= high:
        raise InputError(f"{stated}: must be from {low:g} to {high:g}")


def suggestion(name: str, names: list[str]) -> str:
    """Return a hint for an unknown name: a close match, if there is one, and valid names, cut to a line."""
    close = difflib.get_close_matches(name[:LONGEST_NAME], names, n=1)
    guess = f" (did you mean {close[0]!r}?)" if close else ""
    return f"{guess}; valid: {cut(', '.join(names), 130)}"


def check_sample_time(preset: Preset, sample_time: float) -> int:
    """Return the number of control periods between two samples, which must be a whole one."""
    ratio = sample_time / preset.control_period
    periods = round(ratio) if math.isfinite(ratio) else 0
    if periods < 1 or abs(periods * preset.control_period - sample_time) > 1e-9:
        raise InputError(
            f"sample time {sample_time:g} s: must be a whole multiple of the control period, "
            f"{preset.control_period:g} s"
        )
    return periods


@dataclasses.dataclass(frozen=True)
class Fidelity:
    """Numbers of parts and steps, with the error that they leave.

    Errors are those of the bending angle of both built-in presets in the MuJoCo twin, over records of all
    kinds of signals, against sheaths of 20 elements at an eighth of the default step.
    """

    changes: Mapping[str, Any]  # parameters of a preset by name; the others stay
    rms_deg: float  # RMS error of the bend over a record, at most [deg]
    most_deg: float  # error of the bend at any time, at most [deg]


FIDELITIES = {
    "fine": Fidelity({"sheath_elements": 10, "time_step": 1.25e-3}, 0.1, 0.3),
    "standard": Fidelity({}, 0.3, 0.8),
    "fast": Fidelity({"vertebrae": 8, "time_step": 5e-3}, 0.3, 0.9),
}
"""Each fidelity by its name, from the finest; `standard` is the preset as it stands."""


def at_fidelity(preset: Preset, fidelity: str) -> Preset:
    """Return a preset at a fidelity of `FIDELITIES`: the same endoscope, divided more finely or coarsely."""
    if fidelity not in FIDELITIES:
        raise InputError(f"unknown fidelity {shown(fidelity)}{suggestion(fidelity, list(FIDELITIES))}")
    try:
        return preset.replace(**FIDELITIES[fidelity].changes)
    except InputError as error:
        raise InputError(f"fidelity {fidelity} of {preset.name!r}: {error}") from error
