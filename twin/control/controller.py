"""Controllers: their limits, their knowledge, their interface and their table.

A reference and a measurement in, the pull to command out, sample by sample. Tuning, tables, figures and
`endotwin control` read the table; a new controller is one file in `twin/control/controllers` that calls
`register_controller`.
"""

import abc
import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment
from twin.estimation.learned.ram_twins import RAM_TWINS
from twin.estimation.registry import Style, import_modules
from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset
from twin.simulation import simulate

if TYPE_CHECKING:
    from twin.control.trial import Plant

Array = NDArray[np.float64]
MARGIN = 1.5
"""Command beyond a stroke on either side, as a share of its width: the most that an endoscope of the
ureteroscope's ranges needs to follow the references of a stroke is 1.4."""


@dataclasses.dataclass(frozen=True)
class CommandLimits:
    """Stroke and speed of the commanded pulling distance."""

    low_mm: float
    high_mm: float
    speed_mm_s: float  # fastest change

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low_mm + self.high_mm) and self.low_mm < self.high_mm):
            raise InputError(
                f"stroke [{self.low_mm:g}, {self.high_mm:g}] mm: the first must be below the second"
            )
        if not 0 < self.speed_mm_s < math.inf:
            raise InputError(f"speed = {self.speed_mm_s:g} mm/s: must be positive and finite")

    def wider(self, share: float) -> Self:
        """Return limits that reach beyond either end by a share of the stroke's width."""
        beyond = share * (self.high_mm - self.low_mm)
        return dataclasses.replace(self, low_mm=self.low_mm - beyond, high_mm=self.high_mm + beyond)

    def nearest(self, pull_mm: float) -> float:
        """Return the pull within the stroke that is nearest to one [mm]."""
        return min(max(pull_mm, self.low_mm), self.high_mm)

    def reach(self, pull_mm: float, sample_time: float) -> tuple[float, float]:
        """Return the lowest and the highest pull [mm] one sample after another one."""
        way = self.speed_mm_s * sample_time
        return self.nearest(pull_mm - way), self.nearest(pull_mm + way)

    def within(self, wanted_mm: float, pull_mm: float, sample_time: float) -> float:
        """Return the pull nearest to a wanted one [mm] that can follow `pull_mm`; NaN stays where it is."""
        if math.isnan(wanted_mm):
            wanted_mm = pull_mm
        low, high = self.reach(pull_mm, sample_time)
        return min(max(wanted_mm, low), high)


class Line(NamedTuple):
    """Bend as a linear function of the pull, on one stroke."""

    slope: float  # [deg / mm]
    offset_deg: float  # at no pull
    reached_deg: tuple[float, float]  # lowest and highest bend of the nominal twin on the stroke

    def pull_mm(self, bend_deg: float) -> float:
        """Return the pull that brings a bend, if there were no hysteresis [mm]."""
        return (bend_deg - self.offset_deg) / self.slope


@functools.lru_cache(maxsize=64)  # every trial of a comparison asks for the same few
def fit_line(preset: Preset, stroke_mm: tuple[float, float]) -> Line:
    """Return the line of least squares through the closed loop of an endoscope on a stroke [mm]."""
    low, high = stroke_mm
    sample_time, period = 0.02, 10.0
    time = np.arange(round(2 * period / sample_time)) * sample_time
    pull_mm = (low + high) / 2 + (high - low) / 2 * np.sin(2 * np.pi * time / period)
    episode = simulate(preset, pull_mm * 1e-3, sample_time, physics="reduced")
    closed = slice(len(time) // 2, None)  # the first loop begins inside
    bend = episode.truth_deg[closed]
    slope, offset = np.polyfit(pull_mm[closed], bend, 1)
    return Line(float(slope), float(offset), (float(bend.min()), float(bend.max())))


@dataclasses.dataclass(frozen=True)
class ControlKnowledge:
    """Knowledge before a run, of one endoscope at one sample time."""

    preset: Preset  # the nominal endoscope
    stroke_mm: tuple[float, float]  # lowest and highest pull of the work [mm]
    limits: CommandLimits  # of the command; wider than the stroke
    sample_time: float  # T [s]
    noise_variance: float  # R of the sensor [deg^2]
    deployment: Deployment  # tuned active model on the identified model of Coleman and Hodgdon
    preview_s: float = 0.0  # time for which the reference is known ahead [s]
    policy: Path | None = None  # trained file, by the names of `TRAINED`
    tracking_policy: Path | None = None
    # what was tuned, by controller and name
    settings: Mapping[str, Mapping[str, float]] = dataclasses.field(default_factory=dict)

    @property
    def line(self) -> Line:
        """The linear map of the nominal endoscope."""
        return fit_line(self.preset, self.stroke_mm)

    @property
    def model(self) -> ColemanHodgdon:
        """The identified model."""
        model = self.deployment.fallback.model
        assert isinstance(model, ColemanHodgdon)  # `Deployment.from_dict` refuses others
        return model

    @property
    def active_model(self) -> ActiveModel:
        """The active model with tuned noise, for the sensor."""
        return self.deployment.fallback_at(self.sample_time, self.noise_variance)

    def trained(self, name: str) -> Path:
        """Return a trained file, by its name in `TRAINED`."""
        path: Path | None = getattr(self, name)
        if path is None:
            raise InputError(f"a controller on {TRAINED[name]} needs a trained file")
        return path


NO_PREVIEW = np.empty(0)  # preview of a reference that arrives sample by sample
UNCOMPENSATED = "linear"  # name of the controller that errors are stated as a percentage of
LEAD = "lead_s"  # name of the setting: how long before its time a controller follows its reference [s]


class Sensed(NamedTuple):
    """Input of a controller at one sample."""

    time_s: float
    measurement_deg: float  # NaN where there is none
    reference_deg: float  # wanted angle now
    next_deg: float  # wanted angle at the next sample
    reference_preview_deg: Array = NO_PREVIEW  # (H,) wanted angles from the next sample on, as far as known

    def ahead(self, samples: int) -> Self:
        """Return it with the wanted angles of a later time, as far as they are known."""
        preview = self.reference_preview_deg
        if not samples or not len(preview):
            return self
        now, following = preview[np.minimum([samples - 1, samples], len(preview) - 1)]
        return self._replace(reference_deg=float(now), next_deg=float(following))


class Controller(abc.ABC):
    """A controller of one endoscope, for one run.

    The pull that `step` returns is that of the end of the next sample, bounded to the limits.
    """

    def __init__(self, limits: CommandLimits, sample_time: float) -> None:
        self.limits, self.sample_time = limits, sample_time
        self.lead = 0  # samples by which it follows its reference early, where that is known
        self.pull_mm = self.estimate_deg = math.nan  # latest command, and estimate if it uses one
        self.falls_back = False  # whether a simpler law is in charge, as the better one is not trusted now
        self.holds = False  # whether the command is held, as no measurement comes

    def observe(self, plant: "Plant") -> None:  # noqa: B027  only for an oracle
        """Give an oracle the endoscope itself, before the run begins; other controllers ignore it."""

    def start(self, pull_mm: float, reference_deg: float) -> None:
        """Begin a run on an endoscope that rests at a pull [mm] near a first reference [deg]."""
        self.pull_mm = pull_mm
        self._start(reference_deg)

    def step(self, sensed: Sensed) -> float:
        """Take in a sample and return the pull to command at the next one [mm]."""
        wanted = self._wanted_mm(sensed.ahead(self.lead))
        self.pull_mm = self.limits.within(wanted, self.pull_mm, self.sample_time)
        self._commanded()
        return self.pull_mm

    def _start(self, reference_deg: float) -> None:  # noqa: B027  most have nothing to prepare
        """Prepare what moves, at the first reference [deg]."""

    @abc.abstractmethod
    def _wanted_mm(self, sensed: Sensed) -> float:
        """Return the pull that is wanted at the next sample [mm]; NaN keeps the latest."""

    def _commanded(self) -> None:  # noqa: B027  most need no note
        """Take note of `pull_mm`, which was bounded."""


TRAINED = {"policy": RAM_TWINS.name, "tracking_policy": "PPO on EndoTwin/Tracking-v0"}
"""Trained files that controllers run on: by the field of `ControlKnowledge`, what the file is of."""


class Setting(NamedTuple):
    """A number that is tuned: its default, and the range of the search, logarithmic if its low is not 0."""

    default: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class ControllerSpec:
    """Declaration of one controller."""

    name: str  # on the command line, in tables, figures and files
    rank: float  # place in tables, the smallest first
    information: str  # what it uses, in a few words
    # makes one for a run, with its settings by name
    build: Callable[[ControlKnowledge, Mapping[str, float]], Controller]
    # numbers that are tuned, by name
    settings: Mapping[str, Setting] = dataclasses.field(default_factory=dict)
    needs: str = ""  # trained file that it runs on, by its name in `TRAINED`; empty if it runs on none
    # reads the one sample time that its trained file is for [s]; None if it is for any
    sample_time_of: Callable[[Path], float] | None = None
    leads: bool = True  # whether `LEAD` is tuned for it; False where it uses a preview by itself, or none
    falls_back_on: str = ""  # name of the controller whose settings it takes for its fallback, if it has one
    ours: bool = False  # whether it is this project's own, with which the others are compared
    oracle: bool = False  # whether it knows the endoscope itself: a limit, not a rival
    # in figures
    style: Style = dataclasses.field(default_factory=lambda: Style("#777777", "solid"))

    def make(self, knowledge: ControlKnowledge) -> Controller:
        """Return a new controller, with what was tuned for it."""
        settings = tuned(self.settings, knowledge.settings.get(self.name, {}))
        lead_s = settings.pop(LEAD, 0.0)
        controller = self.build(knowledge, settings)
        controller.lead = round(lead_s / knowledge.sample_time)
        return controller

    def searched(self, preview_s: float) -> dict[str, Setting]:
        """Return the settings that are tuned, where the reference is known ahead for a time [s]."""
        lead = {LEAD: Setting(0.0, 0.0, preview_s)} if self.leads and preview_s > 0 else {}
        return dict(self.settings) | lead


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
    import_modules("twin.control.controllers")
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
    """Return whether a controller knows the endoscope itself."""
    return any(spec.name == name and spec.oracle for spec in controller_specs())
