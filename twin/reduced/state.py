"""State of reduced twins as plain arrays: friction memory, drives, time, and what equilibrium missed."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError
from twin.preset.preset import Preset
from twin.reduced.parameters import Parameters

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

MISSING_LIMIT_N = 1e-6
"""Force that may be missing from equilibrium [N]; with more an endoscope has failed."""


class ReducedState(NamedTuple):
    """State of M endoscopes with P planes, E elements in the sheath of a wire and G groups of hinges.

    Attributes:
        element: (M, P, 2 E) positions of the sheath elements, pulley to tip of the first wire, then tip to
            pulley of its antagonist, towards the end of the chain [m].
        hinge: (M, P, G) angle of a hinge of each group [rad].
        slip: (M, P, 2 E) way that each element slid in the last increment: -1, 0 or 1.
        turn: (M, P, G) the same of each group.
        pulley: (M, P) position of the pulley [m].
        drive: (M, P, 3) motor, its last stride and the gear behind it [m].
        past: (M, P, L) commands of the last control periods that a delay keeps, the last one first [m].
        command: (M, 3) pull [m], lateral pull [m] and bend of the sheath [rad] that it stands at.
        time: (M,) since the start of the run [s].
        travel: (M,) that the pulleys have travelled [m].
        missing: (M,) largest force that was missing from equilibrium since the state was made [N].
        layout: (3,) numbers of planes, elements and vertebrae: endoscopes of others cannot have this state.
    """

    element: Array
    hinge: Array
    slip: Signs
    turn: Signs
    pulley: Array
    drive: Array
    past: Array
    command: Array
    time: Array
    travel: Array
    missing: Array
    layout: NDArray[np.int64]


def new_state(parameters: Parameters, sheath_bend: Array) -> ReducedState:
    """Return the state of endoscopes that are straight, as they are built.

    Args:
        parameters: of M endoscopes.
        sheath_bend: (M,) angle that each sheath is bent by [rad].
    """
    count, planes = parameters.hinge_rest.shape
    elements, groups = parameters.rest.shape[1] - 2, len(parameters.size)
    command = np.zeros((count, 3))
    command[:, :planes] = parameters.zero
    command[:, 2] = sheath_bend
    return ReducedState(
        element=np.zeros((count, planes, elements)),
        hinge=np.zeros((count, planes, groups)),
        slip=np.zeros((count, planes, elements), np.int8),
        turn=np.zeros((count, planes, groups), np.int8),
        pulley=np.zeros((count, planes)),
        drive=np.zeros((count, planes, 3)),
        past=np.repeat(parameters.zero[:, :, None], parameters.late, axis=2),
        command=command,
        time=np.zeros(count),
        travel=np.zeros(count),
        missing=np.zeros(count),
        layout=np.array([planes, elements // 2, parameters.size.sum()], dtype=np.int64),
    )


def not_converged(preset: Preset, missing: float) -> DivergedError:
    """Return the error for an endoscope that found no equilibrium."""
    how_far = f"{missing:g} N are missing" if math.isfinite(missing) else "a force is no number"
    return DivergedError(f"the reduced twin of {preset.name!r} found no equilibrium: {how_far}")
