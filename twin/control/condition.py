"""Conditions of a comparison of controllers: noise, sample time, references, and what happens on the way."""

import dataclasses
import re

import numpy as np
from numpy.typing import NDArray

from twin.control.reference import HOLD_S
from twin.errors import InputError
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.signals.noise import noise_variance

Array = NDArray[np.float64]
SLOW = ("sine", "multi-sine", "random-steps")
BENDING_AT_S, BENDING_S, BENT_BY = 15.0, 3.0, np.pi / 2
"""Bending of the sheath: its begin [s], its time [s] and its angle [rad]."""
CAPSTAN = (("sheath_friction", 0.18), ("sheath_friction_floor", 0.0), ("sheath_friction_growth", 0.0))
"""Another law of friction: all of it grows with the tension, where the ureteroscope's hardly does. It is as
much as that of the nominal one at rest."""
TOUCHED_AT_S = 18.0
"""Begin of a contact at the tip [s]; it stays."""


@dataclasses.dataclass(frozen=True)
class ControlCondition:
    """One line of a comparison.

    Attributes:
        name: in tables and files.
        noise: kind of it.
        level: of it.
        sample_time: T [s].
        signals: kinds of reference.
        bends: whether the sheath bends by a quarter turn on the way, untold.
        tip_force: that pushes the tip sideways from `TOUCHED_AT_S` on, untold; in MuJoCo alone [N].
        wider: factor on the ranges that endoscopes are drawn from.
        changes: parameters that all endoscopes have, whatever was drawn.
    """

    name: str
    noise: str = "gaussian"
    level: float = 1.0
    sample_time: float = 0.02
    signals: tuple[str, ...] = SLOW
    bends: bool = False
    tip_force: float = 0.0
    wider: float = 1.0
    changes: tuple[tuple[str, float], ...] = ()

    @property
    def slug(self) -> str:
        """Name for files: letters, digits, points and _."""
        return re.sub(r"[^A-Za-z0-9.]+", "_", self.name)

    @property
    def variance(self) -> float:
        """R that controllers are told [deg^2]."""
        return noise_variance(self.noise, self.level)

    @property
    def sensor(self) -> tuple[float, float]:
        """R and T of the sensor that controllers are tuned for."""
        return self.variance, self.sample_time

    def draw(self, preset: Preset, ranges: Ranges, rng: np.random.Generator) -> Preset:
        """Return an endoscope that this condition asks for."""
        drawn = (ranges if self.wider == 1.0 else ranges.wider(self.wider)).draw(preset, rng)
        return drawn.replace(**dict(self.changes))

    def tip_forces(self, samples: int) -> Array:
        """Return the force on the tip at each sample [N]; empty where nothing touches it."""
        if not self.tip_force:
            return np.empty(0)
        touched = np.arange(samples) * self.sample_time >= HOLD_S + TOUCHED_AT_S
        return np.where(touched, self.tip_force, 0.0)

    def sheath_bend(self, preset: Preset, samples: int) -> Array:
        """Return the bend of the sheath at each sample [rad]; empty where it stays."""
        if not self.bends:
            return np.empty(0)
        return bending_sheath(preset, samples, self.sample_time, BENDING_AT_S)


def bending_sheath(preset: Preset, samples: int, sample_time: float, begins_s: float) -> Array:
    """Return the bend of a sheath that bends by a quarter turn, from so long behind the hold on [rad]."""
    begun = np.arange(samples) * sample_time - HOLD_S - begins_s
    bend: Array = preset.sheath_bend + BENT_BY * np.clip(begun / BENDING_S, 0.0, 1.0)
    return bend


CONDITIONS = (
    ControlCondition("R = 1"),
    ControlCondition("R = 0.1", level=0.1),
    ControlCondition("R = 5", level=5.0),
    ControlCondition("R = 1, 10 Hz", sample_time=0.1),
    ControlCondition("outliers", "salt-and-pepper", 0.05),
    ControlCondition("Poisson 1", "poisson", 1.0),
    ControlCondition("sine of 4 s", signals=("fast-sine",)),
    ControlCondition("sheath bends", bends=True),
    ControlCondition("tip touched", tip_force=0.1),
    ControlCondition("wider twins", wider=1.5),
    ControlCondition("stick-slip", changes=(("stiction", 0.5),)),
    ControlCondition("capstan friction", changes=CAPSTAN),
    ControlCondition("warm-up, backlash", changes=(("backlash", 3e-4), ("friction_warm_up", 0.5))),
)
SUITES = {"short": CONDITIONS[:1], "full": CONDITIONS}


def find_conditions(suite: str) -> tuple[ControlCondition, ...]:
    """Return the conditions of a suite."""
    if suite not in SUITES:
        raise InputError(f"unknown suite {suite!r:.40}; valid: {', '.join(SUITES)}")
    return SUITES[suite]
