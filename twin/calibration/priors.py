"""Priors of the parameters of an instrument that is only published: what its parts can be."""

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.preset.preset import Preset

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Prior:
    """Prior of one parameter. Distances from its centre are by its logarithm, unless it may be 0.

    Attributes:
        centre: usual value.
        deviation: standard deviation, of the logarithm or of the value.
        limits: lowest and highest value that is believed.
    """

    centre: float
    deviation: float
    limits: tuple[float, float]

    @property
    def bounds(self) -> tuple[float, float]:
        """The limits as distances from the centre [standard deviations]."""
        return self.distance(self.limits[0]), self.distance(self.limits[1])

    def distance(self, value: float) -> float:
        """Return how far a value is from the centre [standard deviations]."""
        if self.limits[0] > 0:
            return float(np.log(value / self.centre)) / self.deviation
        return (value - self.centre) / self.deviation

    def value(self, distance: float) -> float:
        """Return the value at a distance from the centre, within the limits."""
        if self.limits[0] > 0:
            value = self.centre * float(np.exp(distance * self.deviation))
        else:
            value = self.centre + distance * self.deviation
        return float(np.clip(value, *self.limits))


def encode(preset: Preset, priors: Mapping[str, Prior]) -> Array:
    """Return the distances (P,) of a preset's parameters from the centres [standard deviations]."""
    values = (np.clip(getattr(preset, name), *prior.limits) for name, prior in priors.items())
    return np.array([p.distance(float(v)) for p, v in zip(priors.values(), values, strict=True)])


def decode(base: Preset, priors: Mapping[str, Prior], distances: Array) -> Preset:
    """Return the preset at distances (P,) from the centres."""
    values = zip(priors.items(), distances, strict=True)
    return base.replace(**{name: prior.value(distance) for (name, prior), distance in values})


URETEROSCOPE = {
    # Shape-memory section of 40 mm: 10 to 80 N mm / rad, some stiffer where it is bent far.
    "section_stiffness": Prior(0.024, 0.5, (8e-3, 0.08)),
    "section_stiffening": Prior(0.03, 1.0, (2e-3, 0.5)),
    # Pins of hinges that carry the wires' force, and more at the base, which carries all of the section.
    "joint_friction": Prior(8e-4, 0.8, (5e-5, 4e-3)),
    "joint_friction_taper": Prior(0.5, 0.25, (0.0, 0.8)),
    "routing_friction": Prior(0.15, 0.6, (5e-3, 0.4)),  # steel on steel, oiled to dry
    # Wires at the wall of an instrument of 7.5 to 9.5 Fr, 2.5 to 3.2 mm across.
    "wire_offset": Prior(1.1e-3, 0.15, (0.9e-3, 1.4e-3)),
    # A strand of 0.2 to 0.3 mm and 0.7 m, with what yields at its ends; it stiffens as it is laid straight.
    "wire_stiffness": Prior(8e3, 0.5, (3e3, 2e4)),
    # Those of ViO-Com, which are measured, stiffen by 0.2.
    "wire_stiffening": Prior(0.12, 0.7, (2e-3, 0.4)),
    "pretension": Prior(8.0, 0.3, (3.0, 14.0)),  # more than friction takes, or nothing is left at the tip
    # A lined sheath: PTFE against steel, and wires pressed to its wall by their own stiffness.
    "sheath_friction": Prior(0.04, 0.5, (5e-3, 0.12)),
    "sheath_friction_floor": Prior(0.4, 0.6, (0.05, 2.0)),
    "sheath_friction_growth": Prior(1.0, 0.6, (0.1, 4.0)),
}
"""The paper's ureteroscope, by the parts of such instruments."""
