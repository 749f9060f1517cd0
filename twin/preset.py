"""The physical parameters of one endoscope: a frozen dataclass, read from a YAML preset and checked."""

import contextlib
import dataclasses
import difflib
import math
from pathlib import Path
from typing import Any

import yaml

from twin.assets import assets_folder


@dataclasses.dataclass(frozen=True)
class Preset:
    """A tendon-driven endoscope with one bending plane and two antagonistic wires. SI units throughout."""

    name: str
    """What this endoscope is called."""
    vertebrae: int = 16
    """Rigid links of the bending section, each on a hinge."""
    section_length: float = 0.04
    """Length of the bending section [m]."""
    wire_offset: float = 1.3e-3
    """Distance of each wire from the neutral axis: the moment arm at every hinge [m]."""
    section_stiffness: float = 0.05
    """Moment per radian of the whole section [N m / rad]; a hinge is `vertebrae` times as stiff."""
    section_damping: float = 3e-5
    """Viscous moment per bending rate of the whole section [N m s / rad]."""
    joint_friction: float = 1e-3
    """Dry friction torque of one hinge [N m]; independent of `vertebrae` (hinges act in series)."""
    wire_stiffness: float = 8e3
    """Axial stiffness of one whole wire, pulley to tip: E A / length [N / m]."""
    wire_damping: float = 3.0
    """Internal damping of one whole wire against the rate of its stretch [N s / m]."""
    pretension: float = 3.0
    """Tension of both wires at rest [N]."""
    sheath_length: float = 0.6
    """Length of the sheath between pulley and bending section [m]; only drawn, stiffness is of the wire."""
    sheath_elements: int = 5
    """Friction elements along the sheath of each wire."""
    sheath_friction: float = 0.3
    """Coefficient of friction mu between wire and sheath, of the capstan equation."""
    sheath_bend: float = math.pi
    """Total angle phi that the sheath is bent by, of the capstan equation [rad]."""
    sheath_friction_floor: float = 0.1
    """Friction of one wire in its sheath that does not depend on the tension, over the whole sheath [N]."""
    time_step: float = 2e-3
    """Step of the physics [s]."""
    control_period: float = 1e-2
    """Time between two updates of the command and of the load-dependent friction [s]."""
    pulley_radius: float = 0.01
    """Radius of the driving pulley [m]: a pulley angle becomes a pulling distance by it."""

    def __post_init__(self) -> None:
        """Refuse values that no endoscope has.

        Raises:
            ValueError: a parameter is not a finite number or lies outside its physical range.
        """
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name == "name":
                if not isinstance(value, str):
                    raise ValueError(f"preset parameter name = {value!r}: must be text")
                continue
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e300:
                raise ValueError(f"preset parameter {field.name} = {value!r:.40}: must be a finite number")
            if field.name in _COUNTS:
                if not isinstance(value, int) or not 1 <= value <= _COUNTS[field.name]:
                    limit = _COUNTS[field.name]
                    raise ValueError(
                        f"preset parameter {field.name} = {value!r}: must be a whole number from 1 to {limit}"
                    )
            elif field.name in _MAY_BE_ZERO:
                if value < 0:
                    raise ValueError(f"preset parameter {field.name} = {value!r}: must not be negative")
            elif value <= 0:
                raise ValueError(f"preset parameter {field.name} = {value!r}: must be positive")
        steps = self.control_period / self.time_step
        if steps < 1 or abs(steps - round(steps)) > 1e-9:
            raise ValueError(
                f"preset parameter control_period = {self.control_period!r}: "
                f"must be a whole multiple of time_step = {self.time_step!r}"
            )

    def replace(self, **changes: Any) -> "Preset":
        """Return a copy with some parameters changed.

        Raises:
            ValueError: a name is not a parameter, or a value is out of range.
        """
        names = [field.name for field in dataclasses.fields(self)]
        for name in changes:
            if name not in names:
                raise ValueError(f"unknown preset parameter {name!r}{_suggestion(name, names)}")
        return dataclasses.replace(self, **changes)

    def without_friction(self) -> "Preset":
        """Return the same endoscope with every dry friction set to zero."""
        return self.replace(sheath_friction=0.0, sheath_friction_floor=0.0, joint_friction=0.0)

    def without_viscosity(self) -> "Preset":
        """Return the same endoscope with every viscous term set to zero."""
        return self.replace(section_damping=0.0, wire_damping=0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters by name, as a preset file holds them."""
        return dataclasses.asdict(self)


_COUNTS = {"vertebrae": 128, "sheath_elements": 64}
_MAY_BE_ZERO = {
    "section_damping",
    "joint_friction",
    "wire_damping",
    "pretension",
    "sheath_friction",
    "sheath_bend",
    "sheath_friction_floor",
}


def preset_names() -> list[str]:
    """Return the names of the presets that come with the product."""
    return sorted(path.stem for path in assets_folder().glob("*.yaml"))


def load_preset(name_or_path: str | Path) -> Preset:
    """Read a preset by its name in `assets/`, or from a YAML file.

    Raises:
        ValueError: the preset is unknown, or one of its parameters is unknown or out of range.
        FileNotFoundError: a path to a YAML file that does not exist.
    """
    text = str(name_or_path)
    path = Path(text) if text.endswith((".yaml", ".yml")) else assets_folder() / f"{text}.yaml"
    if not path.is_file():
        if path.parent == assets_folder():
            names = preset_names()
            hint = _suggestion(text, names)
            raise ValueError(f"unknown preset {text!r}{hint}; or give the path of a .yaml file")
        raise FileNotFoundError(f"no preset file {path}")
    try:
        values = yaml.safe_load(path.read_text())
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a YAML file: {str(error).splitlines()[0]}") from error
    if not isinstance(values, dict):
        raise ValueError(f"{path} holds no preset: expected `parameter: value` lines")
    named = {str(name): value if name == "name" else _number(value) for name, value in values.items()}
    return Preset(name=path.stem).replace(**named)


def _number(value: Any) -> Any:
    """Read 1e6 as the number that it looks like: YAML 1.1 takes it for text without a point and a sign."""
    if isinstance(value, str):
        with contextlib.suppress(ValueError):
            return float(value)
    return value


def _suggestion(name: str, names: list[str]) -> str:
    close = difflib.get_close_matches(name, names, n=1)
    guess = f" (did you mean {close[0]!r}?)" if close else ""
    return f"{guess}; valid: {', '.join(names)}"
