"""Colours of the wires by their tension: dark where slack, bright where pulled, also in greyscale."""

import dataclasses

import matplotlib
import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode

Array = NDArray[np.float64]

_MAP, _FROM, _TO = "inferno", 0.28, 0.93
PLAIN = np.array([[0.83, 0.18, 0.13], [0.12, 0.38, 0.75], [0.16, 0.55, 0.28], [0.90, 0.58, 0.10]])
"""Colour of each wire where no tension was recorded: a, b, c, d."""


@dataclasses.dataclass(frozen=True)
class TensionColours:
    """Scale of colours from no tension to the highest.

    Attributes:
        highest_n: tension at the bright end [N].
    """

    highest_n: float

    @classmethod
    def of(cls, *episodes: Episode) -> "TensionColours | None":
        """Return the scale that holds every tension of records; None where none was recorded in any."""
        highest = [episode.wire_tension.max() for episode in episodes if episode.wire_tension.size]
        top = float(max(highest, default=0.0))
        return cls(_rounded_up(top)) if top > 0 else None

    def __call__(self, tension: Array) -> Array:
        """Return red, green and blue (..., 3), from 0 to 1, of tensions (...) [N]."""
        share = np.clip(tension / self.highest_n, 0.0, 1.0)
        colours: Array = matplotlib.colormaps[_MAP](_FROM + share * (_TO - _FROM))[..., :3]
        return colours


def _rounded_up(value: float) -> float:
    """Return the next number of two digits that is a multiple of 1, 2 or 5."""
    unit = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10]) * unit
    return float(steps[np.searchsorted(steps, value * (1 - 1e-9))])
