"""Wires in batches: stretch, tension and slack of every segment, from MuJoCo's positions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.wire import quadratic_stiffness, rest_stretch, segment_stiffness, tension_at
from twin.physics.layout import Layout
from twin.preset.preset import Preset

Array = NDArray[np.float64]


class Wires:
    """Wires of B endoscopes of one layout, which may differ in their parameters.

    Attributes:
        stiffness: of a segment at zero tension, (B, 1, 1) [N / m].
        quadratic: quadratic coefficient of a segment, (B, 1, 1) [N / m^2].
        rest_stretch: stretch of each segment at positions of zero, (B, wires, elements + 1) [m].
        lengthening: Jacobian of the segments' lengths, (B, wires * (elements + 1), nq).
    """

    def __init__(self, presets: Sequence[Preset], layout: Layout) -> None:
        """Gather the parameters of all endoscopes, along the leading axis of every array."""
        self._of_one = layout.wire.shape
        self.stiffness = np.array([segment_stiffness(p) for p in presets])[:, None, None]
        self.quadratic = np.array([quadratic_stiffness(p) for p in presets])[:, None, None]
        sides = [bool(wire % 2) for wire in range(layout.wires)]
        self.rest_stretch = np.array([[rest_stretch(p, side) for side in sides] for p in presets])
        self.lengthening = np.array([_lengthening(p, layout) for p in presets])

    def stretch(self, qpos: Array) -> Array:
        """Return the stretch of each segment, (B, wires, elements + 1) [m]; below 0 where slack.

        Args:
            qpos: (B, nq) positions; of one endoscope, at any number of times.
        """
        lengthened = np.matmul(self.lengthening, qpos[:, :, None]).reshape(-1, *self._of_one)
        stretch: Array = self.rest_stretch + lengthened
        return stretch

    def tension_and_slack(self, qpos: Array) -> tuple[Array, Array]:
        """Return tension [N] and slack [m] of each segment, both (B, wires, elements + 1); one of them is 0.

        Args:
            qpos: as of `stretch`.
        """
        stretch = self.stretch(qpos)
        return tension_at(stretch, self.stiffness, self.quadratic), np.maximum(-stretch, 0.0)


def _lengthening(preset: Preset, layout: Layout) -> Array:
    """Return the Jacobian of the wire segments' lengths, (wires * (elements + 1), nq)."""
    lengths = preset.sheath_elements + 1
    matrix = np.zeros((layout.wires, lengths, layout.element.size + layout.pulley.size + layout.hinge.size))
    for wire in range(layout.wires):
        side, plane = 1.0 - 2.0 * (wire % 2), wire // 2
        for element, joint in enumerate(layout.element[wire]):
            matrix[wire, element, joint] = -1.0
            matrix[wire, element + 1, joint] = 1.0
        matrix[wire, 0, layout.pulley[plane]] = side
        matrix[wire, -1, layout.hinge[plane]] = -side * preset.wire_offset
    return matrix.reshape(layout.wires * lengths, -1)
