"""Stick and slip: what is at rest is held by more friction than it slides against (`stiction`).

What has slid in a control period slides on in the next one, against less friction, until it has caught up
with what pulls it. Then it is held again. The tip moves in steps.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.hinges import hinge_groups
from twin.mechanics.wire import segment_stiffness
from twin.physics.layout import Index, Layout
from twin.preset.preset import Preset

Array = NDArray[np.float64]

REST = 1e-3
"""Way within a control period that counts as rest, as a share of the step that stiction leads to [-]."""


class Sticking:
    """Elements and hinges at rest, of B endoscopes of one layout.

    Attributes:
        elements: (B, wires, elements) whether each is held by the friction at rest.
        hinges: (B, planes, groups) whether each group is.
    """

    def __init__(self, presets: Sequence[Preset], layout: Layout) -> None:
        """Begin with all at rest."""
        self._layout = layout
        self._first = np.array([group[0] for group in hinge_groups(presets[0].vertebrae)])
        self._stiction = np.array([preset.stiction for preset in presets])[:, None, None]
        self._element_stiffness = np.array([segment_stiffness(p) for p in presets])[:, None, None]
        self._hinge_stiffness = np.array([p.section_stiffness * p.vertebrae for p in presets])[:, None, None]
        self.elements = np.ones((len(presets), *layout.element.shape), dtype=bool)
        self.hinges = np.ones((len(presets), len(layout.hinge), len(self._first)), dtype=bool)

    def reset(self) -> None:
        """Set all to rest."""
        self.elements[:] = self.hinges[:] = True

    def hold(self, sheath: Array, joints: Array) -> None:
        """Raise the friction of what is at rest, in place.

        Args:
            sheath: (B, wires, elements) friction of sliding [N].
            joints: (B, planes, groups) the same [N m].
        """
        sheath *= 1 + self._stiction * self.elements
        joints *= 1 + self._stiction * self.hinges

    def note(self, way: Array, sheath: Array, joints: Array, moving: Index) -> None:
        """Note what has slid in a control period.

        Args:
            way: (B, nq) change of the positions in it.
            sheath: (B, wires, elements) friction in it [N].
            joints: (B, planes, groups) the same [N m].
            moving: indices of the endoscopes that were stepped.
        """
        element = np.abs(way[:, self._layout.element])
        hinge = np.abs(way[:, self._layout.hinge[:, self._first]])
        element_slid = element > REST * self._stiction * sheath / self._element_stiffness
        hinge_slid = hinge > REST * self._stiction * joints / self._hinge_stiffness
        self.elements[moving] = ~(self.elements & element_slid)[moving]
        self.hinges[moving] = ~(self.hinges & hinge_slid)[moving]
