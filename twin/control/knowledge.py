"""Knowledge of controllers before a run: the nominal endoscope, the sensor, the limits, trained files."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from twin.control.limits import CommandLimits
from twin.control.line import Line, fit_line
from twin.control.registry import TRAINED
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment
from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset


@dataclasses.dataclass(frozen=True)
class ControlKnowledge:
    """Knowledge before a run, of one endoscope at one sample time.

    Attributes:
        preset: the nominal endoscope: what a maker knows of all of a kind.
        stroke_mm: lowest and highest pull of the work [mm].
        limits: of the command; wider than the stroke.
        sample_time: T [s].
        noise_variance: R of the sensor [deg^2].
        deployment: tuned active model on the identified model of Coleman and Hodgdon.
        preview_s: time for which the reference is known ahead [s].
        policy: trained file of RAM (twins); None where there is none.
        tracking_policy: trained file of PPO on `EndoTwin/Tracking-v0`; None where there is none.
        settings: what was tuned, by controller and name.
    """

    preset: Preset
    stroke_mm: tuple[float, float]
    limits: CommandLimits
    sample_time: float
    noise_variance: float
    deployment: Deployment
    preview_s: float = 0.0
    policy: Path | None = None
    tracking_policy: Path | None = None
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
        """The active model with tuned noise, told of the sensor."""
        return self.deployment.fallback_at(self.sample_time, self.noise_variance)

    @property
    def trained(self) -> Path:
        """The trained file of RAM (twins)."""
        return self._trained("policy")

    @property
    def trained_tracking(self) -> Path:
        """The trained file of PPO on `EndoTwin/Tracking-v0`."""
        return self._trained("tracking_policy")

    def _trained(self, name: str) -> Path:
        path: Path | None = getattr(self, name)
        if path is None:
            raise InputError(f"a controller on {TRAINED[name]} needs a trained file")
        return path
