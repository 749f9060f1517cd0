"""The controller table: every controller, declared once, in the file where it lives.

Tuning, tables, figures and `endotwin control` read it. A new controller is one new file in
`twin/control/controllers` that calls `register_controller`.
"""

import dataclasses
import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from twin.errors import InputError
from twin.estimation.learned.ram_twins import RAM_TWINS
from twin.estimation.registry import Style

if TYPE_CHECKING:
    from pathlib import Path

    from twin.control.controller import Controller
    from twin.control.knowledge import ControlKnowledge


TRAINED = {"policy": RAM_TWINS.name, "tracking_policy": "PPO on EndoTwin/Tracking-v0"}
"""Trained files that controllers run on: by the field of `ControlKnowledge`, what the file is of."""


@dataclasses.dataclass(frozen=True)
class Setting:
    """A number that is tuned, on a logarithmic scale.

    Attributes:
        default: where nothing is tuned.
        low: least value of the search.
        high: greatest.
    """

    default: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class ControllerSpec:
    """Declaration of one controller.

    Attributes:
        name: on the command line, in tables, figures and files.
        rank: place in tables, the smallest first.
        told: what it goes by, in a few words.
        build: makes one for a run, with its settings by name.
        settings: numbers that are tuned, by name.
        needs: trained file that it runs on, by its name in `TRAINED`; empty if it runs on none.
        sample_time_of: reads the one sample time that its trained file is for [s]; None if it is for any.
        falls_back_on: name of the controller whose settings it takes for its fallback, if it has one.
        ours: whether it is this project's own, with which the others are compared.
        oracle: whether it is told the endoscope itself: a limit, and no rival.
        style: in figures.
    """

    name: str
    rank: float
    told: str
    build: "Callable[[ControlKnowledge, Mapping[str, float]], Controller]"
    settings: Mapping[str, Setting] = dataclasses.field(default_factory=dict)
    needs: str = ""
    sample_time_of: "Callable[[Path], float] | None" = None
    falls_back_on: str = ""
    ours: bool = False
    oracle: bool = False
    style: Style = dataclasses.field(default_factory=lambda: Style("#777777", "solid", ""))

    def make(self, knowledge: "ControlKnowledge") -> "Controller":
        """Return a new controller, with what was tuned for it."""
        return self.build(knowledge, tuned(self.settings, knowledge.settings.get(self.name, {})))


def tuned(settings: Mapping[str, Setting], found: Mapping[str, float]) -> dict[str, float]:
    """Return the values of settings: what was found by tuning, else their defaults."""
    return {name: setting.default for name, setting in settings.items()} | dict(found)


_SPECS: dict[str, ControllerSpec] = {}


def register_controller(spec: ControllerSpec) -> ControllerSpec:
    """Add a controller to the table and return it."""
    if spec.name in _SPECS:
        raise InputError(f"controller {spec.name!r} is registered already")
    _SPECS[spec.name] = spec
    return spec


def controller_specs() -> tuple[ControllerSpec, ...]:
    """Return all controllers, in the order of tables."""
    package = importlib.import_module("twin.control.controllers")
    for found in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
        importlib.import_module(found.name)
    return tuple(sorted(_SPECS.values(), key=lambda spec: (spec.rank, spec.name)))


def find_controllers(names: Sequence[str]) -> tuple[ControllerSpec, ...]:
    """Return the controllers of these names, in the order of tables; `all` is every one."""
    specs = controller_specs()
    known = [spec.name for spec in specs]
    for name in names:
        if name != "all" and name not in known:
            raise InputError(f"unknown controller {name!r:.60}; valid: all, {', '.join(known)}")
    return tuple(spec for spec in specs if "all" in names or spec.name in names)


def is_oracle(name: str) -> bool:
    """Return whether a controller is told the endoscope itself."""
    return any(spec.name == name and spec.oracle for spec in controller_specs())
