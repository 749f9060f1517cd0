"""Hinges of the bending section: in groups of neighbours, each with its dry friction."""

import numpy as np
from numpy.typing import NDArray

from twin.preset.preset import Preset

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def hinge_groups(vertebrae: int) -> list[Index]:
    """Return the hinges, base to tip, in at most 8 groups of neighbours that share a friction constraint."""
    return np.array_split(np.arange(vertebrae), min(vertebrae, 8))


def group_of_hinge(vertebrae: int) -> Index:
    """Return the number of the group that each hinge is in, base to tip, (vertebrae,)."""
    sizes = [len(group) for group in hinge_groups(vertebrae)]
    return np.repeat(np.arange(len(sizes)), sizes)


def joint_friction(preset: Preset) -> Array:
    """Return the dry friction torque of a hinge of each group, base to tip, (groups,) [N m]."""
    place = (np.arange(preset.vertebrae) + 0.5) / preset.vertebrae
    of_hinges = preset.joint_friction * (1 + preset.joint_friction_taper * (1 - 2 * place))
    return np.array([of_hinges[group].mean() for group in hinge_groups(preset.vertebrae)])
