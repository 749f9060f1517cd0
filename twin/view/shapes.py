"""Poses of what the viewer draws: one shape for all links, all wires and all parts of the sheath.

Lengths are in those of the bending section, so that every endoscope fills the picture.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.episode import WIRE_PLACES, WIRES
from twin.mechanics.kinematics import Frames, link_frames
from twin.preset.preset import Preset
from twin.view.session import Pose

Array = NDArray[np.float64]


class Poses(NamedTuple):
    """Positions (n, 3) and unit quaternions (n, 4), w first, of copies of one shape."""

    position: Array
    quaternion: Array


class Placed(NamedTuple):
    """Poses of all shapes; each has its middle at its own origin and is along x."""

    links: Poses
    wires: Poses  # those of wire a, then b, ..., base to tip
    tip: Poses
    force: Array  # (2, 3) tail and head of the arrow that pushes the tip


def place(preset: Preset, pose: Pose, largest_force_n: float = 1.0) -> Placed:
    """Return where the bending section is; the largest force is an arrow of half its length."""
    length, count = preset.section_length, preset.vertebrae
    frames = link_frames(pose.joint_angle[None], pose.lateral_joint_angle[None], length)
    position, rotation = frames.position[0] / length, frames.rotation[0]
    links = Frames(position[:-1] + rotation[:-1, :, 0] / (2 * count), rotation[:-1])
    places = np.array([(0.0, *WIRE_PLACES[wire]) for wire in WIRES[: preset.wires]])
    offset = preset.wire_offset / length * np.einsum("vij,wj->wvi", links.rotation, places)
    wires = Frames((links.position + offset).reshape(-1, 3), np.tile(links.rotation, (len(places), 1, 1)))
    tip = Frames(position[-1:], rotation[-1:])
    tail = position[-1] - 0.5 * pose.tip_force_n / largest_force_n * rotation[-1, :, 2]
    return Placed(_poses(links), _poses(wires), _poses(tip), np.array([tail, position[-1]]))


def place_sheath(preset: Preset, bend: float) -> Poses:
    """Return where the parts of the sheath are, base to pulley, when it is bent by an angle [rad]."""
    from twin.physics.drawing.surfaces import sheath_frames

    frames = sheath_frames(preset, bend)
    middle = (frames.position[1:] + frames.position[:-1]) / 2 / preset.section_length
    return _poses(Frames(middle, frames.rotation[1:]))


def _poses(frames: Frames) -> Poses:
    from scipy.spatial.transform import Rotation

    return Poses(frames.position, Rotation.from_matrix(frames.rotation).as_quat(scalar_first=True))
