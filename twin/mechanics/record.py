"""Record of a simulation: an `Episode` from what either twin read at every sample."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode
from twin.mechanics.command import Command

Array = NDArray[np.float64]


def record_of(
    command: Command,
    *,
    bend: Array,
    joint_angle: Array,
    wire_tension: Array,
    sheath_friction: Array,
    wire_slack: Array,
    pulley: Array,
    metadata: dict[str, Any],
) -> Episode:
    """Return the record of a simulation.

    Args:
        command: what it followed, N samples.
        bend: (N, planes) bending angle [rad].
        joint_angle: (N, planes, vertebrae) angle of each hinge, base to tip [rad].
        wire_tension: (N, wires, elements + 1) [N].
        sheath_friction: (N, wires, elements) [N].
        wire_slack: (N, wires, elements + 1) [m].
        pulley: (N,) distance that the pulley has pulled wire a [m].
        metadata: of the twin, beside preset and version.
    """
    lateral: dict[str, Any] = {}
    if command.preset.bending_planes == 2:
        lateral = {
            "lateral_pull": command.lateral_pull,
            "lateral_bend": bend[:, 1],
            "lateral_joint_angle": joint_angle[:, 1],
        }
    return Episode(
        time=np.arange(len(bend), dtype=float) * command.sample_time,
        pull=command.pull,
        bend=bend[:, 0],
        measured_bend=bend[:, 0].copy(),
        joint_angle=joint_angle[:, 0],
        wire_tension=wire_tension,
        sheath_friction=sheath_friction,
        pulley=pulley,
        sheath_bend=command.sheath_bend,
        wire_slack=wire_slack,
        **lateral,
        metadata={"preset": command.preset.to_dict(), "endotwin": __version__} | metadata,
    )
