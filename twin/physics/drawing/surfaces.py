"""Surfaces of the drawn endoscope: smooth tubes around a centre line that bends, as skins of MuJoCo.

A skin's vertices follow the frames ("bones") that they are bound to. A vertex between the middles of two
links is bound to both, by its distances, so that a chain of rigid links is drawn as one smooth curve. The
drawn sheath is a centre line of its own, from the base to the pulley.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.mechanics.kinematics import Frames
from twin.preset.preset import Preset

Array = NDArray[np.float64]
Faces = NDArray[np.int32]

_SHEATH_LENGTHS, _SHEATH_RADII = 4.0, 36.0
SHEATH_BONES = 40  # frames along the drawn sheath
_STRAIGHT = 0.12  # share of the drawn sheath that is straight at either end
_RISE = 3.2  # height that it gains over a whole turn, in distances of the wires: a loop passes over itself


@dataclasses.dataclass(frozen=True)
class Bones:
    """Frames that a skin is bound to, along the x axis in the pose of rest."""

    names: tuple[str, ...]  # of the bodies
    origin: Array  # (bones,) where the body's frame is at rest [m]
    middle: Array  # (bones,) where a vertex follows this bone alone, increasing [m]


@dataclasses.dataclass(frozen=True)
class Surface:
    """Triangles of a part of a tube, at rest along the x axis."""

    vertices: Array  # (n, 3) [m]
    faces: Faces  # (m, 3) indices of vertices, counter-clockwise as seen from outside

    def __add__(self, other: "Surface") -> "Surface":
        faces = np.concatenate([self.faces, other.faces + len(self.vertices)])
        return Surface(np.concatenate([self.vertices, other.vertices]), faces)


def round_tube(along: Array, radius: float, sides: int, place: tuple[float, float] = (0.0, 0.0)) -> Surface:
    """Return a closed tube with rings at places `along` (n,) and its centre line at `place` (y, z) [m]."""
    sheet = _sheet(along, np.full(len(along), radius), np.zeros(len(along)), sides)
    return Surface(sheet.vertices + np.array([0.0, *place]), sheet.faces)


def open_shell(
    along: Array, outer: Array, inner: Array, opening: Array, sides: int, towards: float
) -> tuple[Surface, Surface]:
    """Return a tube with a wall, cut open lengthwise, and the faces of the cut.

    Its rings at places `along` (n,) have an outer and an inner radius [m]; half the angle `opening` is cut
    out of each, about the direction `towards`, from y towards z [rad].
    """
    outside = _sheet(along, outer, opening, sides, towards)
    inside = _sheet(along, inner, opening, sides, towards)
    inside = Surface(inside.vertices, inside.faces[:, ::-1])
    rings, around = len(along), sides + 1
    out, within = (surface.vertices.reshape(rings, around, 3) for surface in (outside, inside))
    rim = _strip(within[0], out[0]) + _strip(out[-1], within[-1])
    if opening.any():
        rim = rim + _strip(out[:, 0], within[:, 0]) + _strip(within[:, -1], out[:, -1])
    return outside + inside, rim


def window(along: Array, start: float, end: float, half_angle: float, corner: float) -> Array:
    """Return half the angle of an opening from `start` to `end`, with round corners, at each ring [rad]."""
    depth = np.clip(np.minimum(along - start, end - along) / corner, 0.0, 1.0)
    opened: Array = half_angle * np.sqrt(1 - (1 - depth) ** 2)
    return opened


def add_skin(spec: mujoco.MjSpec, name: str, surface: Surface, bones: Bones, material: str) -> None:
    """Add a surface to a model as a skin that follows its bones."""
    weights = _weights(surface.vertices[:, 0], bones.middle)
    used = [(bone, np.flatnonzero(column > 0)) for bone, column in enumerate(weights.T)]
    used = [(bone, held) for bone, held in used if len(held)]
    skin = spec.add_skin(name=name, material=material)
    skin.vert = surface.vertices.ravel().tolist()
    skin.face = surface.faces.ravel().tolist()
    skin.bodyname = [bones.names[bone] for bone, _ in used]
    skin.bindpos = np.array([[bones.origin[bone], 0.0, 0.0] for bone, _ in used]).ravel().tolist()
    skin.bindquat = np.tile([1.0, 0.0, 0.0, 0.0], len(used)).tolist()
    skin.vertid = [held.tolist() for _, held in used]
    skin.vertweight = [weights[held, bone].tolist() for bone, held in used]


def rings(stops: Sequence[float], spacing: float) -> Array:
    """Return places of rings through given stops, evenly between two of them, at most `spacing` apart [m]."""
    parts = [
        np.linspace(start, end, max(int(np.ceil((end - start) / spacing - 1e-9)), 1), endpoint=False)
        for start, end in itertools.pairwise(stops)
    ]
    return np.concatenate([*parts, [stops[-1]]])


def _sheet(along: Array, radius: Array, opening: Array, sides: int, towards: float = 0.0) -> Surface:
    """Return the surface at a radius, without the opening; its sides meet where there is none."""
    share = np.linspace(0.0, 1.0, sides + 1)
    angle = towards + opening[:, None] + share * (2 * np.pi - 2 * opening[:, None])
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1) * radius[:, None, None]
    vertices = np.concatenate([np.repeat(along[:, None, None], sides + 1, axis=1), ring], axis=-1)
    return Surface(vertices.reshape(-1, 3), grid_faces(len(along), sides + 1))


def _strip(first: Array, second: Array) -> Surface:
    return Surface(np.concatenate([first, second]), grid_faces(2, len(first)))


def grid_faces(rows: int, columns: int) -> Faces:
    """Return two triangles for each cell of a grid of vertices, outside of a tube of rows along x."""
    index = np.arange(rows * columns).reshape(rows, columns)
    here, right = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    below, across = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    faces = np.concatenate([np.stack([here, right, across], 1), np.stack([here, across, below], 1)])
    return faces.astype(np.int32)


def _weights(along: Array, middle: Array) -> Array:
    """Return how much each vertex (n,) follows each bone, (n, bones): linear between their middles."""
    place = np.interp(along, middle, np.arange(len(middle)))
    lower = np.minimum(place.astype(int), max(len(middle) - 2, 0))
    share = place - lower
    weights = np.zeros((len(along), len(middle)))
    weights[np.arange(len(along)), lower] = 1 - share
    if len(middle) > 1:
        weights[np.arange(len(along)), lower + 1] += share
    return weights


def drawn_sheath_length(preset: Preset) -> float:
    """Return the length of the drawn sheath [m]: at its true length all else would be tiny.

    It is some lengths of the bending section, or enough for a thick one to be bent.
    """
    return max(_SHEATH_LENGTHS * preset.section_length, _SHEATH_RADII * preset.wire_offset)


def sheath_frames(preset: Preset, bend: float) -> Frames:
    """Return frames along the drawn sheath, evenly from the base to the pulley, (`SHEATH_BONES` + 1).

    Straight at both ends, it turns by `bend` in the horizontal plane, away from the viewer.
    """
    length = drawn_sheath_length(preset)
    share = np.linspace(0.0, 1.0, 20 * SHEATH_BONES + 1)
    turned = bend * _smooth(np.clip((share - _STRAIGHT) / (1 - 2 * _STRAIGHT), 0.0, 1.0))
    rise = _RISE * preset.wire_offset * turned / (2 * np.pi)
    along = np.stack([np.cos(turned), np.sin(turned)], axis=1)  # against the path
    steps = (along[1:] + along[:-1]) / 2 * length / (len(share) - 1)
    flat = np.concatenate([np.zeros((1, 2)), -np.cumsum(steps * [1, -1], axis=0)])
    position = np.column_stack([flat[:, 0], flat[:, 1], rise])[::20]
    turned = turned[::20]
    rotation = np.zeros((len(turned), 3, 3))
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(turned)
    rotation[:, 0, 1], rotation[:, 1, 0] = np.sin(turned), -np.sin(turned)
    rotation[:, 2, 2] = 1.0
    return Frames(position, rotation)


def _smooth(share: Array) -> Array:
    """Return the share of the bend that is reached: the curvature rises and falls over a tenth."""
    edge = 0.1
    rising = np.where(share < edge, share**2 / (2 * edge), share - edge / 2)
    end = 1 - share
    falling = (1 - edge) - np.where(end < edge, end**2 / (2 * edge), end - edge / 2)
    reached: Array = np.where(share < 0.5, rising, falling) / (1 - edge)
    return reached
