"""Scratch arrays of an advance of reduced twins: kernels make none."""

from typing import NamedTuple

import numpy as np

from twin.reduced.both_chain import BothPlanes, new_both_planes
from twin.reduced.chain import Array, Work, new_work
from twin.reduced.parameters import Parameters


class Workspace(NamedTuple):
    """Scratch arrays for one endoscope at a time. What a None excludes is not compiled.

    Attributes:
        plane: with one bending plane, else None.
        both: with two, else None.
        begin: (3,) pull [m], lateral pull [m] and bend of the sheath [rad] before the sample.
        way: (P,) of each pulley since the last increment [m].
        ahead: (P, 3) each drive one control period later, as of `ReducedState`.
    """

    plane: Work | None
    both: BothPlanes | None
    begin: Array
    way: Array
    ahead: Array


def new_workspace(parameters: Parameters) -> Workspace:
    """Return scratch arrays for endoscopes of one layout; each thread needs its own."""
    planes, elements = parameters.hinge_rest.shape[1], (parameters.rest.shape[1] - 2) // 2
    groups = len(parameters.size)
    return Workspace(
        plane=new_work(elements, groups) if planes == 1 else None,
        both=new_both_planes(elements, groups) if planes == 2 else None,
        begin=np.zeros(3),
        way=np.zeros(planes),
        ahead=np.zeros((planes, 3)),
    )
