"""Settings of a comparison of controllers, and the trials that they ask for."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from twin.control.condition import CONDITIONS, SLOW, ControlCondition, bending_sheath
from twin.control.knowledge import ControlKnowledge
from twin.control.limits import MARGIN, CommandLimits
from twin.control.reference import SIGNALS, reference
from twin.control.trial import ControlCase
from twin.errors import InputError
from twin.estimation.deployment import Deployment, prepare_deployment
from twin.files.bounded import sha256_of
from twin.files.bounds import check_between
from twin.identification.coleman_hodgdon import identify_coleman_hodgdon
from twin.identification.nominal import nominal_records
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.signals.noise import draw_noise
from twin.signals.streams import SeedUse, random_stream

PREVIEW_S = 1.0
"""Time for which a reference is known ahead, where nothing else is asked for [s]."""
MODEL_SAMPLE_TIME, MODEL_STRIDE = 0.02, 5  # of the records that a model is identified on
TUNING = (*((kind, False) for kind in SLOW), ("fast-sine", False), ("multi-sine", True))
"""References of the tuning, and whether the sheath bends meanwhile: settings are to serve quick work and a
change of the endoscope, too."""


@dataclasses.dataclass(frozen=True)
class ControlSettings:
    """Settings of a comparison.

    Attributes:
        preset: the nominal endoscope.
        ranges: from which those that are controlled are drawn.
        strokes_mm: strokes of the work; references use the middle of what each reaches [mm].
        twins: number of held-out endoscopes.
        seconds: length of a reference behind its hold [s].
        margin: command beyond the stroke, as a share of its width [-].
        speed_mm_s: speed limit of the command and of the endoscope's servo [mm / s].
        latency_s: delay of the sensor [s].
        preview_s: time for which controllers know the reference ahead [s].
        physics: of the plants.
        policy: trained file of RAM (twins), if there is one.
        tracking_policy: trained file of PPO on `EndoTwin/Tracking-v0`, if there is one.
        candidates: settings that are tried for each controller.
        tuning_seconds: length of a reference of the tuning [s].
        seed: of everything that is drawn.
    """

    preset: Preset
    ranges: Ranges
    strokes_mm: tuple[tuple[float, float], ...] = ((-1.0, 1.0), (2.0, 4.0))
    twins: int = 10
    seconds: float = 40.0
    margin: float = MARGIN
    speed_mm_s: float = 5.0
    latency_s: float = 0.0
    preview_s: float = PREVIEW_S
    physics: str = "mujoco"
    policy: Path | None = None
    tracking_policy: Path | None = None
    candidates: int = 16
    tuning_seconds: float = 12.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
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
        return ControlKnowledge(
            self.preset,
            stroke_mm,
            self.limits(stroke_mm),
            sample_time,
            variance,
            deployment,
            self.preview_s,
            self.policy,
            self.tracking_policy,
        )

    def find_deployment(self, stroke_mm: tuple[float, float]) -> Deployment:
        """Return the model that is identified on the nominal endoscope, and its active model, tuned."""
        records = nominal_records(self.preset, stroke_mm, self.seed, MODEL_SAMPLE_TIME, MODEL_STRIDE)
        model = identify_coleman_hodgdon(records, self.seed)[0]
        return prepare_deployment(records, model, MODEL_SAMPLE_TIME * MODEL_STRIDE, self.seed)

    def held_out(self, number: int, condition: ControlCondition = CONDITIONS[0]) -> Preset:
        """Return an endoscope that is scored under a condition, with the servo of the limits."""
        return self._drawn(SeedUse.CONTROL_TWINS, number, condition)

    def _drawn(self, stream: SeedUse, number: int, condition: ControlCondition = CONDITIONS[0]) -> Preset:
        rng = random_stream(self.seed, stream, number)
        drawn = condition.draw(self.preset, self.ranges, rng)
        speed = self.speed_mm_s * 1e-3
        if drawn.servo_speed:
            speed = min(speed, drawn.servo_speed)
        return drawn.replace(servo_speed=speed, sensor_latency=drawn.sensor_latency + self.latency_s)

    def cases(
        self, condition: ControlCondition, stroke_mm: tuple[float, float], knowledge: ControlKnowledge
    ) -> list[ControlCase]:
        """Return the case of every trial of a condition on a stroke: all twins on all signals."""
        place = self.strokes_mm.index(stroke_mm)
        cases = []
        for number in range(self.twins):
            preset = self.held_out(number, condition)
            for kind in condition.signals:
                which = place, number, SIGNALS.index(kind)
                rng = random_stream(self.seed, SeedUse.CONTROL_REFERENCES, *which)
                wanted = self._reference(kind, knowledge, self.seconds, rng)
                rng = random_stream(self.seed, SeedUse.CONTROL_NOISE, *which)
                noise = draw_noise(condition.noise, condition.level, (len(wanted),), rng)
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
            wanted = self._reference(kind, knowledge, seconds, rng)
            rng = random_stream(self.seed, SeedUse.CONTROL_TUNING_NOISE, place, number)
            noise = draw_noise("gaussian", knowledge.noise_variance, (len(wanted),), rng)
            preset = self._drawn(SeedUse.CONTROL_TUNING_TWINS, place * len(TUNING) + number)
            bend = bending_sheath(preset, len(wanted), sample_time, seconds / 3) if bends else np.empty(0)
            cases.append(ControlCase(preset, wanted, noise, bend, physics="reduced"))
        return cases

    def _reference(
        self, kind: str, knowledge: ControlKnowledge, seconds: float, rng: np.random.Generator
    ) -> np.ndarray:
        reached = knowledge.line.reached_deg
        return reference(kind, reached, seconds, knowledge.sample_time, rng)

    def to_dict(self) -> dict[str, Any]:
        """Return all that results depend on, as plain values."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        values |= {"preset": self.preset.to_dict(), "ranges": self.ranges.to_dict()}
        values["strokes_mm"] = [list(stroke) for stroke in self.strokes_mm]
        values["policy"] = None if self.policy is None else sha256_of(self.policy)
        # Left out where there is none: comparisons of before this field go on.
        del values["tracking_policy"]
        if self.tracking_policy is not None:
            values["tracking_policy"] = sha256_of(self.tracking_policy)
        return values
