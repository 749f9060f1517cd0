"""The endoscope for viewers: hinge angles, a chain of frames turned by them, and a 3D scene of its parts.

The shapes are those of the twin's own pictures (`twin/physics/model.py`), in the primitives of Foxglove's
`SceneUpdate`, whose cylinders stand along z; each is fixed to a frame that `/tf` moves.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from twin.episode import WIRE_COLOURS, WIRE_PLACES, WIRES, Episode
from twin.errors import InputError
from twin.recording.chunks import SECOND

Array = NDArray[np.float64]
LATERAL_HINGE = "lateral_hinge_"  # prefix of the names of the hinges in the plane of wires c and d
BASE = "base"  # frame at the end of the sheath, where the bending section begins
_SHEATH = _TIP = (0.15, 0.17, 0.21)
_BACKBONE = (0.42, 0.45, 0.50)
_VERTEBRA = (0.60, 0.63, 0.68)
_LENS = (0.35, 0.62, 0.85)

# Of the distance of the wires from the axis.
_SHEATH_RADIUS, _TIP_RADIUS, _VERTEBRA_RADIUS, _LENS_RADIUS, _BACKBONE_RADIUS = 1.35, 1.3, 1.05, 0.6, 0.45
_WIRE_THICKNESS = 0.3
# Of the length of a link.
_VERTEBRA_BEGINS, _VERTEBRA_ENDS, _TIP_BEGINS = 0.2, 0.8, 0.7
_SHEATH_SHOWN = 0.5  # of the length of the bending section: the entire sheath would be out of the picture
_TAPER = 0.94  # of the far end of a vertebra: an edge that separates it from the next one


def hinge_angles(episode: Episode) -> dict[str, Array]:
    """Return the angle of each hinge (N,) by name [rad]: `hinge_0` ..., then `lateral_hinge_0` ..."""
    angles = {f"hinge_{index}": angle for index, angle in enumerate(episode.joint_angle.T)}
    if len(episode.lateral_joint_angle) > 0:
        lateral = enumerate(episode.lateral_joint_angle.T)
        angles |= {f"{LATERAL_HINGE}{index}": angle for index, angle in lateral}
    return angles


def joint_states(names: Sequence[str], angles: Sequence[float], nanoseconds: int) -> Any:
    """Return the `JointStates` message of the hinge angles at one sample [rad]."""
    joints = [JointState(name=name, position=angle) for name, angle in zip(names, angles, strict=True)]
    return JointStates(timestamp=_stamp(nanoseconds), joints=joints)


def link_length(episode: Episode) -> float | None:
    """Return the length of one vertebra [m], or None where the metadata does not state it."""
    preset = episode.metadata.get("preset")
    if not isinstance(preset, Mapping) or not {"section_length", "vertebrae"} <= set(preset):
        return None
    joints = int(episode.joint_angle.shape[1])
    if preset["vertebrae"] != joints:
        raise InputError(f"joint_angle has {joints} columns, the preset {preset['vertebrae']} vertebrae")
    return float(preset["section_length"]) / joints


def rotations(episode: Episode) -> dict[str, Array]:
    """Return the rotation of each frame relative to the one before: (N, vertebrae) by part of a quaternion.

    A vertebra is turned by its hinge h about (0, -1, 0) and then by its lateral hinge l, if any, about
    (0, 0, 1): (cos(h/2) - sin(h/2) j) (cos(l/2) + sin(l/2) k), i = j k. In one plane x and z are left out.
    """
    half = np.asarray(episode.joint_angle, dtype=float) / 2
    y, w = -np.sin(half), np.cos(half)
    if len(episode.lateral_joint_angle) == 0:
        return {"y": y, "w": w}
    half = np.asarray(episode.lateral_joint_angle, dtype=float) / 2
    sine, cosine = np.sin(half), np.cos(half)
    return {"x": y * sine, "y": y * cosine, "z": w * sine, "w": w * cosine}


def transforms(link: float, parts: Sequence[str], values: Sequence[float], nanoseconds: int) -> Any:
    """Return the `FrameTransforms` message base -> vertebra_0 -> vertebra_1 ... of one sample.

    `link` is the length of a vertebra [m]; `values` are those parts of the quaternions that are not zero, of
    each vertebra, all of the first part first.
    """
    stamp, vertebrae = _stamp(nanoseconds), len(values) // len(parts)
    frames = [
        FrameTransform(
            timestamp=stamp,
            parent_frame_id=f"vertebra_{index - 1}" if index else "base",
            child_frame_id=f"vertebra_{index}",
            translation=Vector3(x=link if index else 0.0),
            rotation=Quaternion(**dict(zip(parts, values[index::vertebrae], strict=True))),
        )
        for index in range(vertebrae)
    ]
    return FrameTransforms(transforms=frames)


def _stamp(nanoseconds: int) -> Any:
    seconds, nanos = divmod(nanoseconds, SECOND)
    return Timestamp(seconds=seconds, nanos=nanos)


def scene(episode: Episode, nanoseconds: int) -> SceneUpdate | None:
    """Return the message that draws the endoscope from a time [ns] on, in the pose that `/tf` gives.

    It has an entity for each frame, named as its frame. None without joints, or where the preset in the
    metadata does not state `section_length`, `vertebrae`, `wire_offset` and `bending_planes`.
    """
    preset = episode.metadata.get("preset")
    if episode.joint_angle.shape[1] == 0 or not isinstance(preset, Mapping):
        return None
    link = link_length(episode)
    if link is None or not {"wire_offset", "bending_planes"} <= set(preset):
        return None
    offset, wires = float(preset["wire_offset"]), WIRES[: 2 * preset["bending_planes"]]
    message = SceneUpdate()
    sheath = _entity(message, BASE, nanoseconds)
    _cylinder(sheath, -_SHEATH_SHOWN * preset["section_length"], 0.0, _SHEATH_RADIUS * offset, _SHEATH)
    for index in range(preset["vertebrae"]):
        vertebra = _entity(message, f"vertebra_{index}", nanoseconds)
        _draw_link(vertebra, link, offset, wires)
    _draw_tip(vertebra, link, offset)
    return message


def _draw_link(entity: Any, link: float, offset: float, wires: str) -> None:
    _cylinder(entity, 0.0, link, _BACKBONE_RADIUS * offset, _BACKBONE)
    start, end = _VERTEBRA_BEGINS * link, _VERTEBRA_ENDS * link
    _cylinder(entity, start, end, _VERTEBRA_RADIUS * offset, _VERTEBRA, taper=_TAPER)
    for wire, colour in zip(wires, WIRE_COLOURS, strict=False):
        y, z = WIRE_PLACES[wire]
        line = entity.lines.add(type=LinePrimitive.LINE_STRIP, thickness=_WIRE_THICKNESS * offset)
        line.pose.orientation.w = 1.0
        for x in (0.0, link):
            line.points.add(x=x, y=y * offset, z=z * offset)
        _paint(line, colour)


def _draw_tip(entity: Any, link: float, offset: float) -> None:
    end = link + _WIRE_THICKNESS / 2 * offset
    _cylinder(entity, _TIP_BEGINS * link, end, _TIP_RADIUS * offset, _TIP)
    lens = entity.spheres.add()
    lens.pose.position.x = link
    lens.pose.orientation.w = 1.0
    lens.size.x = lens.size.y = lens.size.z = 2 * _LENS_RADIUS * offset
    _paint(lens, _LENS)


def _entity(message: SceneUpdate, frame: str, nanoseconds: int) -> Any:
    """Add the entity of a frame, which stays for ever (a lifetime of zero) and moves with the frame."""
    entity = message.entities.add(frame_id=frame, id=frame, frame_locked=True)
    entity.timestamp.FromNanoseconds(nanoseconds)
    entity.lifetime.SetInParent()
    return entity


def _cylinder(
    entity: Any, start: float, end: float, radius: float, colour: tuple[float, ...], taper: float = 1.0
) -> None:
    """Add a cylinder along x from `start` to `end`, where its radius is `taper` times as large [m]."""
    cylinder = entity.cylinders.add(bottom_scale=1.0, top_scale=taper)
    cylinder.pose.position.x = (start + end) / 2
    # From z to x: a quarter of a turn about y.
    cylinder.pose.orientation.y = cylinder.pose.orientation.w = math.sqrt(0.5)
    cylinder.size.x = cylinder.size.y = 2 * radius
    cylinder.size.z = end - start
    _paint(cylinder, colour)


def _paint(shape: Any, colour: tuple[float, ...]) -> None:
    shape.color.r, shape.color.g, shape.color.b = colour
    shape.color.a = 1.0
