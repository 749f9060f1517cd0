"""Companions of a trained estimator in its deployment: a fallback, and the limits of the training."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.files.shown import shown
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]
KEY = "deployment"
"""Name in the description of a trained file."""
WIDER = 0.1
"""Share of what was met by which a limit lies beyond it."""


@dataclasses.dataclass(frozen=True)
class Deployment:
    """A trusted fallback, and the limits of what a trained estimator has met.

    Attributes:
        fallback: the active model with tuned noise (AM-tuned); R is told by the sensor.
        pull_mm: lowest and highest pulling distance of the training [mm].
        bend_deg: lowest and highest angle [deg].
        pull_speed_mm_s: of the fastest command [mm / s].
        bend_speed_deg_s: of the fastest motion [deg / s].
    """

    fallback: ActiveModel
    pull_mm: tuple[float, float]
    bend_deg: tuple[float, float]
    pull_speed_mm_s: float
    bend_speed_deg_s: float

    def fallback_at(self, sample_time: float, noise_variance: float) -> ActiveModel:
        """Return the fallback for a sample time [s] and a sensor [deg^2].

        Q is a random walk's: it grows with the time between two samples.
        """
        longer = sample_time / self.fallback.sample_time
        of_bend, of_error = self.fallback.process_variance
        return dataclasses.replace(
            self.fallback,
            sample_time=sample_time,
            process_variance=(of_bend * longer, of_error * longer),
            measurement_variance=noise_variance,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain values, as a trained file holds them."""
        return {
            "fallback": self.fallback.to_dict(),
            "pull_mm": list(self.pull_mm),
            "bend_deg": list(self.bend_deg),
            "pull_speed_mm_s": self.pull_speed_mm_s,
            "bend_speed_deg_s": self.bend_speed_deg_s,
        }

    @classmethod
    def from_dict(cls, values: Any) -> Self:
        """Return the deployment of what `to_dict` returned.

        Raises:
            ValueError: a value is missing, is no number or is out of range.
        """
        if not isinstance(values, Mapping):
            raise InputError(f"{KEY} = {shown(values)}: must be its parts by name")
        from twin.files.json_text import validated
        from twin.files.trained_schema import DeploymentFile

        try:
            file = validated(DeploymentFile, values)
            fallback = ActiveModel.from_dict(file.fallback)
        except ValueError as error:
            raise InputError(f"{KEY}: {error}") from error
        if not isinstance(fallback.model, ColemanHodgdon):
            raise InputError(f"{KEY}: the fallback's model is {fallback.model.name}: must be coleman-hodgdon")
        return cls(fallback, file.pull_mm, file.bend_deg, file.pull_speed_mm_s, file.bend_speed_deg_s)


def prepare_deployment(
    records: Sequence[tuple[Array, Array]], model: ColemanHodgdon, sample_time: float, seed: int
) -> Deployment:
    """Return the deployment of an estimator that is trained on these records.

    Args:
        records: `(pull_mm (N,), true bend_deg (N,))` at even samples.
        model: identified on them, or on records of the same endoscope.
        sample_time: T [s].
        seed: of the noise that the fallback is tuned under.
    """
    from twin.runtime.tuning import tune_fallback  # of training alone: a runtime begins without it

    fallback = tune_fallback(ActiveModel(model, sample_time), records, seed)
    pulls, bends = ([record[part] for record in records] for part in (0, 1))
    return Deployment(
        fallback, _limits(pulls), _limits(bends), _speed(pulls, sample_time), _speed(bends, sample_time)
    )


def _limits(values: Sequence[Array]) -> tuple[float, float]:
    low, high = min(float(of.min()) for of in values), max(float(of.max()) for of in values)
    beyond = WIDER * (high - low)
    return low - beyond, high + beyond


def _speed(values: Sequence[Array], sample_time: float) -> float:
    fastest = max(float(np.abs(np.diff(of)).max(initial=0.0)) for of in values)
    return (1 + WIDER) * fastest / sample_time
