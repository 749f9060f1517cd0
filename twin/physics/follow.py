"""Friction and damping at the tension of the wires: the kernel that every control period calls."""

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.compiled import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]
NEARLY_TAUT = 1e-6
"""Slack up to which a wire counts as taut [m]."""


@compiled
def follow_load(
    qpos: Array,
    qvel: Array,
    hinge: Index,
    pulley: Index,
    element: Index,
    wire: Array,
    rest_stretch: Array,
    half_share: Array,
    floor: Array,
    steps: Array,
    sheath: Array,
    damping: Array,
    inertia: Array,
    at_tip: Array,
) -> None:
    """Write the friction of the sheath and the damping of the wires of B endoscopes.

    These are `tension_at` and `element_friction`, segment by segment from the pulley to the tip.
    Damping holds, beside the wire's own, time step times stiffness: with it, and with as much inertia times
    the time step, a step is one of backward Euler (`model.py`). A segment that will be taut before the next
    update has it already.

    Args:
        qpos: (B, nq) positions.
        qvel: (B, nv) velocities.
        hinge: (planes, vertebrae), as of `Layout`.
        pulley: (planes,), as of `Layout`.
        element: (wires, elements), as of `Layout`.
        wire: (B, 4) moment arm [m], stiffness k [N / m] and k2 [N / m^2] of a segment, own damping
            [N s / m].
        rest_stretch: (B, wires, elements + 1) stretch of each segment at positions of zero [m].
        half_share: (B,) half the friction of an element per unit of the tension on both its sides [-].
        floor: (B,) friction of an element that does not depend on the tension [N].
        steps: (2,) time step, and how far ahead a segment counts as taut [s].
        sheath: (B, wires, elements), where friction goes [N].
        damping: (B, wires, elements + 1), where damping goes [N s / m].
        inertia: (B, wires, elements + 1), where the inertia of that damping goes [kg].
        at_tip: (B, wires), where the tension at the tip goes [N].
    """
    time_step, ahead = steps
    wires, elements = element.shape
    for b in range(len(qpos)):
        arm, stiffness, quadratic, own = wire[b]
        for w in range(wires):
            plane, side = w // 2, 1.0 - 2.0 * (w % 2)
            start, start_rate = side * qpos[b, pulley[plane]], side * qvel[b, pulley[plane]]
            before = 0.0
            for i in range(elements + 1):
                if i < elements:
                    end, end_rate = qpos[b, element[w, i]], qvel[b, element[w, i]]
                else:
                    end, end_rate = 0.0, 0.0
                    for joint in hinge[plane]:
                        end += qpos[b, joint]
                        end_rate += qvel[b, joint]
                    end, end_rate = side * arm * end, side * arm * end_rate
                stretch = rest_stretch[b, w, i] + start - end
                soon = stretch + ahead * (start_rate - end_rate)
                taut = max(stretch, 0.0)
                tension = taut * (stiffness + quadratic * taut)
                if i > 0:
                    sheath[b, w, i - 1] = half_share[b] * (tension + before) + floor[b]
                damping[b, w, i] = 0.0
                if max(stretch, soon) > -NEARLY_TAUT:
                    damping[b, w, i] = own + time_step * (stiffness + 2 * quadratic * taut)
                inertia[b, w, i] = time_step * damping[b, w, i]
                before, start, start_rate = tension, end, end_rate
            at_tip[b, w] = before
