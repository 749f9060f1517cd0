"""Conditions of a comparison of controllers: references, noise, sensors, and disturbances."""

import dataclasses
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from twin.control.controller import MARGIN, CommandLimits, ControlKnowledge
from twin.control.trial import HOLD_S, ControlCase
from twin.errors import InputError
from twin.estimation.deployment import Deployment, prepare_deployment
from twin.evaluation.protocol import SEALED
from twin.files.bounded import sha256_of
from twin.files.bounds import check_between
from twin.identification.models import identify_coleman_hodgdon
from twin.identification.nominal import nominal_records
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.signals.excitation import command
from twin.signals.noise import draw_noise, noise_variance
from twin.signals.streams import SeedUse, random_stream

if TYPE_CHECKING:
    from twin.evaluation.sealed import SealedSensor

Array = NDArray[np.float64]
SHARE = 0.65  # of what the nominal endoscope reaches on a stroke
FAST_PERIOD_S = 4.0
SLOW = ("sine", "multi-sine", "random-steps")
SIGNALS = (*SLOW, "fast-sine")  # kinds of reference; slow ones are those of datasets


def reference(
    kind: str, reached_deg: tuple[float, float], seconds: float, sample_time: float, rng: np.random.Generator
) -> Array:
    """Return a reference (N,) [deg]: `HOLD_S` at its start, then `seconds` of a signal.

    It uses the middle `SHARE` of the bends that the stroke reaches; `rng` draws period, phase and levels.
    """
    if kind not in SIGNALS:
        raise InputError(f"unknown reference {kind!r:.40}; valid: {', '.join(SIGNALS)}")
    middle, half = sum(reached_deg) / 2, SHARE * (reached_deg[1] - reached_deg[0]) / 2
    if kind == "fast-sine":
        if not seconds >= 2 * sample_time:
            raise InputError(
                f"{seconds:g} s at a sample time of {sample_time:g} s: needs at least two samples"
            )
        time = np.arange(round(seconds / sample_time)) * sample_time
        moving = middle + half * np.sin(2 * np.pi * time / FAST_PERIOD_S)
    else:
        moving = command(kind, (middle - half, middle + half), seconds, sample_time, rng)
    return np.concatenate([np.full(round(HOLD_S / sample_time), moving[0]), moving])


BENDING_AT_S, BENDING_S, BENT_BY = 15.0, 3.0, np.pi / 2  # of the sheath: begin, time, angle [rad]
TOUCHED_AT_S = 18.0  # begin of a contact at the tip; it stays
CAPSTAN = (("sheath_friction", 0.18), ("sheath_friction_floor", 0.0), ("sheath_friction_growth", 0.0))
"""Friction that all grows with the tension, where the ureteroscope's hardly does; at rest it is as much."""


@dataclasses.dataclass(frozen=True)
class ControlCondition:
    """One line of a comparison."""

    name: str  # in tables and files
    noise: str = "gaussian"  # kind of it
    level: float = 1.0  # of it
    sample_time: float = 0.02  # T [s]
    signals: tuple[str, ...] = SLOW  # kinds of reference
    bends_by: float = 0.0  # angle by which the sheath bends on the way, unannounced [rad]
    tip_force: float = 0.0  # that pushes the tip sideways from some time on, unannounced; only in MuJoCo [N]
    begins_s: float | None = None  # when either begins [s]; `BENDING_AT_S` and `TOUCHED_AT_S` if None
    wider: float = 1.0  # factor on the ranges that endoscopes are drawn from
    changes: tuple[tuple[str, float], ...] = ()  # parameters that all endoscopes have, whatever was drawn
    errors: "SealedSensor | None" = None  # a drawn sensor, whose kind and level are `noise` and `level`
    seed: int | None = None  # of endoscopes, references and noise; that of the comparison if None

    @property
    def slug(self) -> str:
        """Name for files: letters, digits, points and _."""
        return re.sub(r"[^A-Za-z0-9.]+", "_", self.name)

    @property
    def variance(self) -> float:
        """R that controllers are given [deg^2]."""
        return self.errors.variance_deg2 if self.errors else noise_variance(self.noise, self.level)

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
        begins_s = TOUCHED_AT_S if self.begins_s is None else self.begins_s
        touched = np.arange(samples) * self.sample_time >= HOLD_S + begins_s
        return np.where(touched, self.tip_force, 0.0)

    def sheath_bend(self, preset: Preset, samples: int) -> Array:
        """Return the bend of the sheath at each sample [rad]; empty where it stays."""
        if not self.bends_by:
            return np.empty(0)
        begins_s = BENDING_AT_S if self.begins_s is None else self.begins_s
        return bending_sheath(preset, samples, self.sample_time, begins_s, self.bends_by)

    def draw_noise(self, samples: int, rng: np.random.Generator) -> Array:
        """Draw the errors of the sensor [deg]."""
        if self.errors:
            return self.errors.errors(np.zeros(samples), self.sample_time, rng)
        return draw_noise(self.noise, self.level, (samples,), rng)


def bending_sheath(
    preset: Preset, samples: int, sample_time: float, begins_s: float, bends_by: float = BENT_BY
) -> Array:
    """Return the bend of a sheath that bends by an angle, from this long after the hold on [rad]."""
    begun = np.arange(samples) * sample_time - HOLD_S - begins_s
    bend: Array = preset.sheath_bend + bends_by * np.clip(begun / BENDING_S, 0.0, 1.0)
    return bend


CONDITIONS = (
    ControlCondition("R = 1"),
    ControlCondition("R = 0.1", level=0.1),
    ControlCondition("R = 5", level=5.0),
    ControlCondition("R = 1, 10 Hz", sample_time=0.1),
    ControlCondition("outliers", "salt-and-pepper", 0.05),
    ControlCondition("Poisson 1", "poisson", 1.0),
    ControlCondition("sine of 4 s", signals=("fast-sine",)),
    ControlCondition("sheath bends", bends_by=BENT_BY),
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
        raise InputError(f"unknown suite {suite!r:.40}; valid: {', '.join(SUITES)}, {SEALED}")
    return SUITES[suite]


PREVIEW_S = 1.0  # for which a reference is known ahead by default
MODEL_SAMPLE_TIME, MODEL_STRIDE = 0.02, 5  # of the records that a model is identified on
TUNING = (*((kind, False) for kind in SLOW), ("fast-sine", False), ("multi-sine", True))
"""References of the tuning, and whether the sheath bends meanwhile."""


@dataclasses.dataclass(frozen=True)
class ControlSettings:
    """Settings of a comparison."""

    preset: Preset  # the nominal endoscope
    ranges: Ranges  # from which those that are controlled are drawn
    # strokes of the work; references use the middle of what each reaches [mm]
    strokes_mm: tuple[tuple[float, float], ...] = ((-1.0, 1.0), (2.0, 4.0))
    twins: int = 10  # number of held-out endoscopes
    seconds: float = 40.0  # length of a reference after its hold [s]
    margin: float = MARGIN  # command beyond the stroke, as a share of its width [-]
    speed_mm_s: float = 5.0  # speed limit of the command and of the endoscope's servo [mm / s]
    latency_s: float = 0.0  # delay of the sensor [s]
    preview_s: float = PREVIEW_S  # time for which controllers know the reference ahead [s]
    physics: str = "mujoco"  # of the plants
    policy: Path | None = None  # trained file of RAM (twins), if there is one
    tracking_policy: Path | None = None  # trained file of PPO on `EndoTwin/Tracking-v0`, if there is one
    candidates: int = 16  # settings that are tried for each controller
    tuning_seconds: float = 12.0  # length of a reference of the tuning [s]
    seed: int = 0  # of everything that is drawn

    def __post_init__(self) -> None:
        check_between("twins", self.twins, 1, 1000)
        check_between("seconds", self.seconds, 1.0, 3600.0)
        check_between("preview_s", self.preview_s, 0.0, 60.0)
        check_between("margin", self.margin, 0.0, 10.0)
        check_between("candidates", self.candidates, 1, 1000)
        if not self.strokes_mm:
            raise InputError("no stroke given: name at least one")
        for stroke in self.strokes_mm:
            self.limits(stroke)

    def limits(self, stroke_mm: tuple[float, float]) -> CommandLimits:
        """Return the limits of the command on a stroke [mm]."""
        return CommandLimits(*stroke_mm, self.speed_mm_s).wider(self.margin)

    def knowledge(
        self, stroke_mm: tuple[float, float], sensor: tuple[float, float], deployment: Deployment
    ) -> ControlKnowledge:
        """Return what a controller may know on a stroke, with a sensor of some R [deg^2] and T [s]."""
        variance, sample_time = sensor
        limits, trained = self.limits(stroke_mm), (self.policy, self.tracking_policy)
        known = self.preset, stroke_mm, limits, sample_time, variance, deployment
        return ControlKnowledge(*known, self.preview_s, *trained)

    def find_deployment(self, stroke_mm: tuple[float, float]) -> Deployment:
        """Return the model that is identified on the nominal endoscope, and its active model, tuned."""
        records = nominal_records(self.preset, stroke_mm, self.seed, MODEL_SAMPLE_TIME, MODEL_STRIDE)
        model = identify_coleman_hodgdon(records, self.seed)[0]
        return prepare_deployment(records, model, MODEL_SAMPLE_TIME * MODEL_STRIDE, self.seed)

    def held_out(
        self,
        number: int,
        condition: ControlCondition = CONDITIONS[0],
        stream: SeedUse = SeedUse.CONTROL_TWINS,
    ) -> Preset:
        """Return an endoscope that is scored under a condition, with the servo of the limits."""
        rng = random_stream(self._seed(condition), stream, number)
        drawn = condition.draw(self.preset, self.ranges, rng)
        speed = min(self.speed_mm_s * 1e-3, drawn.servo_speed or math.inf)
        return drawn.replace(servo_speed=speed, sensor_latency=drawn.sensor_latency + self.latency_s)

    def _seed(self, condition: ControlCondition) -> int:
        return self.seed if condition.seed is None else condition.seed

    def cases(self, condition: ControlCondition, knowledge: ControlKnowledge) -> list[ControlCase]:
        """Return the case of every trial of a condition on a stroke: all twins on all signals."""
        place = self.strokes_mm.index(knowledge.stroke_mm)
        cases = []
        for number in range(self.twins):
            preset = self.held_out(number, condition)
            for kind in condition.signals:
                which = place, number, SIGNALS.index(kind)
                rng = random_stream(self._seed(condition), SeedUse.CONTROL_REFERENCES, *which)
                reached = knowledge.line.reached_deg
                wanted = reference(kind, reached, self.seconds, knowledge.sample_time, rng)
                rng = random_stream(self._seed(condition), SeedUse.CONTROL_NOISE, *which)
                noise = condition.draw_noise(len(wanted), rng)
                bend, force = condition.sheath_bend(preset, len(wanted)), condition.tip_forces(len(wanted))
                cases.append(ControlCase(preset, wanted, noise, bend, force, self.physics))
        return cases

    def tuning_cases(self, knowledge: ControlKnowledge) -> list[ControlCase]:
        """Return the cases that settings are tried on: other twins, reduced, one for each of `TUNING`."""
        place, sample_time = self.strokes_mm.index(knowledge.stroke_mm), knowledge.sample_time
        seconds = min(self.tuning_seconds, self.seconds)
        cases = []
        for number, (kind, bends) in enumerate(TUNING):
            rng = random_stream(self.seed, SeedUse.CONTROL_TUNING_REFERENCES, place, number)
            wanted = reference(kind, knowledge.line.reached_deg, seconds, sample_time, rng)
            rng = random_stream(self.seed, SeedUse.CONTROL_TUNING_NOISE, place, number)
            noise = draw_noise("gaussian", knowledge.noise_variance, (len(wanted),), rng)
            twin = place * len(TUNING) + number
            preset = self.held_out(twin, stream=SeedUse.CONTROL_TUNING_TWINS)
            bend = bending_sheath(preset, len(wanted), sample_time, seconds / 3) if bends else np.empty(0)
            cases.append(ControlCase(preset, wanted, noise, bend, physics="reduced"))
        return cases

    def to_dict(self) -> dict[str, Any]:
        """Return all that results depend on, as plain values."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        values |= {"preset": self.preset.to_dict(), "ranges": self.ranges.to_dict()}
        values["strokes_mm"] = [list(stroke) for stroke in self.strokes_mm]
        for name in ("policy", "tracking_policy"):
            values[name] = None if values[name] is None else sha256_of(values[name])
        return values
