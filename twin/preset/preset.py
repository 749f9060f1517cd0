"""Physical parameters of one endoscope: a frozen dataclass, read from a YAML preset and checked."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from twin.errors import InputError
from twin.files.bounds import check_name
from twin.files.shown import shown, suggestion


def _within(default: float, low: float, high: float) -> Any:
    """Return a field with a default and physical limits."""
    return dataclasses.field(default=default, metadata={"low": low, "high": high})


ZERO_DEVIATION_DEG = 2.0
"""Standard deviation of a zero without calibration [deg]. If it is too small, intervals are wrong."""


@dataclasses.dataclass(frozen=True)
class Preset:
    """Tendon-driven endoscope: one or two bending planes with two antagonistic wires each. SI units.

    The moment of the bent section is section_stiffness * b * (1 + section_stiffening * b^2), with the bend b
    counted from `initial_bend`. Every friction but that of the sheath at rest (`stiction`) is that of
    sliding. `wire_stiffness` is that of the entire wire, through the sheath.
    """

    name: str

    # The bending section.
    bending_planes: int = _within(1, 1, 2)  # 1 has two wires (a, b); 2 has four (c and d bend it sideways)
    wires_per_plane: int = _within(2, 1, 2)  # 2: antagonistic; 1: a and c alone, not wound up
    vertebrae: int = _within(16, 1, 128)  # rigid links, each on a hinge or on two crossed ones
    section_length: float = _within(0.04, 1e-3, 2.0)  # [m]
    section_mass: float = _within(2e-4, 1e-9, 10.0)  # [kg]
    section_stiffness: float = _within(0.05, 1e-6, 1e3)  # of the entire section, hinges in series [N m / rad]
    section_stiffening: float = _within(0.0, 0.0, 20.0)  # [1 / rad^2]
    section_damping: float = _within(3e-5, 0.0, 10.0)  # viscous, of the entire section [N m s / rad]
    initial_bend: float = _within(0.0, -math.pi, math.pi)  # where no wire pulls [rad]
    lateral_initial_bend: float = _within(0.0, -math.pi, math.pi)  # the same, of wires c and d [rad]
    joint_friction: float = _within(1e-3, 0.0, 10.0)  # mean dry friction of one hinge [N m], for any number
    joint_friction_taper: float = _within(
        0.0, -1.0, 1.0
    )  # 1 + taper times that at the base, 1 - it at the tip
    wire_offset: float = _within(1.3e-3, 1e-4, 0.1)  # of each wire from the axis, its moment arm [m]
    routing_friction: float = _within(0.0, 0.0, 2.0)  # coefficient of wires on the vertebrae [-]

    # The wires.
    wire_stiffness: float = _within(8e3, 10.0, 1e6)  # E A / length of an entire wire, without tension [N / m]
    wire_stiffening: float = _within(0.0, 0.0, 10.0)  # growth with tension [1 / N]: strands and liner settle
    wire_toe: float = _within(0.0, 0.0, 100.0)  # tension up to which an entire wire is soft [N]
    wire_damping: float = _within(3.0, 0.0, 1e5)  # of one entire wire against its stretch rate [N s / m]
    pretension: float = _within(3.0, 0.0, 500.0)  # as wound up, at the pulley [N]; less at the tip
    wire_slack: float = _within(0.0, 0.0, 0.02)  # of each wire in a new, straight endoscope [m]

    # The sheath.
    sheath_length: float = _within(0.6, 1e-3, 10.0)  # between pulley and bending section [m]; only drawn
    sheath_elements: int = _within(5, 1, 64)  # friction elements along the sheath of each wire
    sheath_friction: float = _within(0.3, 0.0, 2.0)  # coefficient mu of the capstan equation [-]
    sheath_bend: float = _within(math.pi, 0.0, 8 * math.pi)  # angle phi [rad]; a run may give its own
    sheath_bend_offset: float = _within(0.0, 0.0, 8 * math.pi)  # wrap angle in a straight sheath [rad]
    sheath_friction_floor: float = _within(0.1, 0.0, 100.0)  # without tension, of one wire, straight [N]
    sheath_friction_growth: float = _within(0.0, 0.0, 100.0)  # what a bend of one radian adds to it [N]
    sheath_friction_exponent: float = _within(1.0, 0.1, 4.0)  # p of growth * bend^p [-]
    friction_warm_up: float = _within(0.0, -0.9, 5.0)  # excess at the start of a run [-], which decays
    warm_up_time: float = _within(60.0, 1e-2, 1e6)  # time constant of that [s]
    friction_wear: float = _within(0.0, 0.0, 100.0)  # growth per distance that the pulleys travel [1 / m]
    stiction: float = _within(0.0, 0.0, 5.0)  # excess of friction at rest [-]: the tip moves in steps

    # The drive.
    pulley_radius: float = _within(0.01, 1e-4, 1.0)  # [m]; converts an angle to a pulling distance
    command_zero: float = _within(0.0, -0.1, 0.1)  # where it is neutral [m]: pulley = command - zero
    lateral_command_zero: float = _within(0.0, -0.1, 0.1)  # the same of wires c and d [m]
    command_delay: float = _within(0.0, 0.0, 0.5)  # after which the motor follows a command [s]
    backlash: float = _within(0.0, 0.0, 0.01)  # play between motor and pulley, at the pulley [m]
    servo_gain: float = _within(0.0, 0.0, 1e3)  # of the position loop [1 / s]; 0 follows without lag
    servo_speed: float = _within(0.0, 0.0, 10.0)  # limit, as pulling speed [m / s]; 0 is none
    servo_acceleration: float = _within(0.0, 0.0, 1e3)  # limit [m / s^2]; 0 is none
    encoder_counts: int = _within(0, 0, 2**24)  # of the motor's encoder in a turn; 0 is continuous

    # The sensor of the bending angle: it reads scale * angle + zero.
    sensor_zero: float = _within(0.0, -math.pi, math.pi)  # reading where the section is straight [rad]
    # standard deviation of what is known of the zero [rad]; 0: calibrated
    sensor_zero_deviation: float = _within(math.radians(ZERO_DEVIATION_DEG), 0.0, math.pi)
    sensor_scale: float = _within(1.0, 0.1, 10.0)  # reading per angle [-]
    sensor_period: float = _within(0.0, 0.0, 10.0)  # between two readings [s]; 0 reads every sample
    sensor_latency: float = _within(0.0, 0.0, 10.0)  # from the measurement of a reading to its arrival [s]
    sensor_resolution: float = _within(0.0, 0.0, 1.0)  # quantisation step of a reading [rad]; 0 is none
    sensor_noise: float = _within(0.0, 0.0, 1.0)  # standard deviation, Gaussian, of a reading [rad]

    # The world.
    gravity_x: float = _within(0.0, -100.0, 100.0)  # along the shaft, towards the tip [m / s^2]
    gravity_y: float = _within(0.0, -100.0, 100.0)  # across the plane of wires a and b [m / s^2]
    gravity_z: float = _within(0.0, -100.0, 100.0)  # in that plane, towards wire a [m / s^2]
    time_step: float = _within(2.5e-3, 1e-6, 0.02)  # of the physics [s]
    control_period: float = _within(1e-2, 1e-6, 0.1)  # of command and load-dependent friction [s]

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
        names = ("sheath_friction", "sheath_friction_floor", "sheath_friction_growth")
        return self.replace(**dict.fromkeys((*names, "joint_friction", "routing_friction"), 0.0))

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
            rule = "must be NAME=VALUE, as in wire_stiffness=2e4"
            if name in whole:
                rule = "a whole number is needed"
            raise InputError(f"change of the preset {shown(change)}: {rule}") from error
    return parsed


def _check(field: "dataclasses.Field[Any]", value: Any) -> None:
    low, high = field.metadata["low"], field.metadata["high"]
    rule = ""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e300:
        rule = "must be a finite number"
    elif isinstance(field.default, int) and (not isinstance(value, int) or not low <= value <= high):
        rule = f"must be a whole number from {low} to {high}"
    elif value <= 0 and low > 0:
        rule = "must be positive"
    elif value < 0 and low == 0:
        rule = "must not be negative"
    elif not low <= value <= high:
        rule = f"must be from {low:g} to {high:g}"
    if rule:
        raise InputError(f"preset parameter {field.name} = {shown(value)}: {rule}")


def at_sample_time(preset: Preset, sample_time: float) -> Preset:
    """Return the endoscope with a control period, at most its own, that divides the time between samples [s].

    Where its own does, nothing is changed.
    """
    ratio = sample_time / preset.control_period
    if not 0 < ratio < 1e6:
        raise InputError(f"sample time {sample_time:g} s: must be positive, at most 1e6 control periods")
    if abs(ratio - max(round(ratio), 1)) * preset.control_period <= 1e-9:
        return preset
    period = sample_time / math.ceil(ratio)
    steps = math.ceil(period / preset.time_step - 1e-9)
    return preset.replace(control_period=period, time_step=period / steps)


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
    kinds of signals, against sheaths of 20 elements at steps of 0.31 ms.
    """

    changes: Mapping[str, Any]  # parameters of a preset by name; the others stay
    rms_deg: float  # RMS error of the bend over a record, at most [deg]
    most_deg: float  # error of the bend at any time, at most [deg]


FIDELITIES = {
    "fine": Fidelity({"sheath_elements": 10, "time_step": 2.5e-3}, 0.1, 0.3),
    "standard": Fidelity({}, 0.3, 0.8),
    "fast": Fidelity({"vertebrae": 8, "time_step": 1e-2}, 0.3, 0.9),
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
