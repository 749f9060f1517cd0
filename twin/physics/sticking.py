"""Stick and slip: elements of the sheath at rest are held by more than they slide against (`stiction`).

An element that has broken away slides until it has caught up with what pulls it; then it is held again. The
tip moves in steps. Friction falls within some control periods: MuJoCo takes two time steps to brake what
slides, so that an element let go at once would slide several times too far.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import CAUGHT_UP
from twin.physics.layout import Index, Layout
from twin.preset.preset import Preset

Array = NDArray[np.float64]

BREAKS_AWAY = 0.99
"""Force beyond sliding friction at which an element breaks away, as a share of what stiction adds [-]."""
FALL = 0.8
"""Factor within a control period on what stiction adds to the friction of an element that slides [-]."""


class Sticking:
    """Elements at rest, of B endoscopes of one layout. With two planes, neighbours stick and slip as one.

    Attributes:
        grip: (B, sides, elements) share of what stiction adds that holds each, 1 at rest [-]; the sides are
            wires a and b, or with two planes a with c and b with d.
    """

    def __init__(self, presets: Sequence[Preset], layout: Layout) -> None:
        """Begin with all at rest."""
        self._wires: Index = np.arange(layout.wires).reshape(len(layout.hinge), -1)
        self._stiction = np.array([preset.stiction for preset in presets])[:, None, None]
        self.grip = np.ones((len(presets), self._wires.shape[1], layout.element.shape[1]))

    def reset(self) -> None:
        """Set all to rest."""
        self.grip[:] = 1.0

    def hold(self, sheath: Array, tension: Array) -> None:
        """Let go what breaks away, hold what has caught up, and raise the friction of both, in place.

        Args:
            sheath: (B, wires, elements) friction of sliding [N].
            tension: (B, wires, elements + 1) of the segments, without damping [N].
        """
        pulled = (np.diff(tension, axis=2) / sheath)[:, self._wires]
        beyond = np.sqrt((pulled**2).sum(axis=1)) - 1.0
        slides = (beyond >= BREAKS_AWAY * self._stiction) | (self.grip < 1.0)
        self.grip[slides] *= FALL
        self.grip[beyond <= CAUGHT_UP * self._stiction] = 1.0
        for wires in self._wires:
            sheath[:, wires] *= 1 + self._stiction * self.grip
