"""Indices into MuJoCo's arrays, looked up by name once and used at every control period."""

import dataclasses

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.episode import WIRES
from twin.mechanics.friction import hinge_groups
from twin.preset.preset import Preset

Index = NDArray[np.intp]
PLANES = ("", "lateral_")  # prefix of the joints of each bending plane
NEIGHBOURS = (("a", "c"), ("b", "d"))  # wires of two planes that rub as one
WAYS = ("along", "across")  # prefix of the friction of neighbours along the force that it holds, and across


@dataclasses.dataclass(frozen=True)
class Layout:
    """Indices of joints and tendons in MuJoCo's arrays; positions and velocities share those of joints."""

    hinge: Index  # joints of the hinges, base to tip, (planes, vertebrae)
    pulley: Index  # joints of the pulleys, (planes,)
    element: Index  # joints of the sheath elements, pulley to tip, (wires, elements)
    wire: Index  # tendons of the wire segments, pulley to tip, (wires, elements + 1)
    joints: Index  # tendons with the friction of the hinges, base to tip, (1, groups): of one plane alone
    shared: Index
    """Tendons that carry the friction of neighbours, along and across, (2, pairs): elements of wires a and c,
    of b and d, pulley to tip, then hinges, base to tip; none with one plane."""
    wrap: Index  # coefficients of those tendons, pair after pair, (2, wraps)

    @classmethod
    def of(cls, model: mujoco.MjModel, preset: Preset) -> "Layout":
        """Look up all indices in the compiled model of a preset."""
        planes, wires = PLANES[: preset.bending_planes], WIRES[: preset.wires]
        vertebrae, elements = range(preset.vertebrae), range(preset.sheath_elements)
        lengths, groups = range(preset.sheath_elements + 1), range(len(hinge_groups(preset.vertebrae)))
        one = preset.bending_planes == 1
        pairs = [f"{a}{c}{i}" for a, c in NEIGHBOURS for i in elements] + [f"joints_{i}" for i in groups]
        shared = np.array(
            [[model.tendon(f"{way}_{pair}").id for pair in pairs] if not one else [] for way in WAYS],
            dtype=np.intp,
        )
        wraps = [
            np.arange(model.tendon_adr[i], model.tendon_adr[i] + model.tendon_num[i]) for i in shared.flat
        ]
        return cls(
            hinge=np.array([[model.joint(f"{p}hinge_{i}").qposadr[0] for i in vertebrae] for p in planes]),
            pulley=np.array([model.joint(f"{p}pulley").qposadr[0] for p in planes]),
            element=np.array([[model.joint(f"sheath_{w}{i}").qposadr[0] for i in elements] for w in wires]),
            wire=np.array([[model.tendon(f"wire_{w}{i}").id for i in lengths] for w in wires]),
            joints=np.array([[model.tendon(f"joints_{i}").id for i in groups] if one else []], dtype=np.intp),
            shared=shared,
            wrap=np.concatenate([*wraps, np.empty(0, dtype=np.intp)]).reshape(2, -1).astype(np.intp),
        )


def consecutive(index: Index) -> slice:
    """Return the slice of indices that follow one another: it takes a view of an array, they take a copy."""
    start = int(index.flat[0]) if index.size else 0
    if not np.array_equal(index.flat, np.arange(start, start + index.size)):
        raise ValueError(f"the indices {index.ravel().tolist()} do not follow one another")
    return slice(start, start + index.size)
