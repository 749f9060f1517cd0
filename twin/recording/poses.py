"""Poses of the bending section for viewers: hinge angles, and a chain of frames turned by them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.recording.mcap_file.layout import SECOND

Array = NDArray[np.float64]

LATERAL_HINGE = "lateral_hinge_"
"""Prefix of the names of the hinges in the plane of wires c and d."""


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
    """Return the length of one vertebra [m], or None where the metadata does not state it.

    Raises:
        ValueError: the metadata has another number of vertebrae than the joints.
    """
    preset = episode.metadata.get("preset")
    if not isinstance(preset, Mapping) or not {"section_length", "vertebrae"} <= set(preset):
        return None
    joints = int(episode.joint_angle.shape[1])
    if preset["vertebrae"] != joints:
        raise InputError(f"joint_angle has {joints} columns, the preset {preset['vertebrae']} vertebrae")
    return float(preset["section_length"]) / joints


def rotations(episode: Episode) -> dict[str, Array]:
    """Return the rotation of each frame relative to the one before it, as parts of unit quaternions.

    A vertebra is turned by its hinge about (0, -1, 0) and then, in the turned frame, by its lateral hinge
    about (0, 0, 1), if there is one. The quaternion of that is
    (cos(h/2) - sin(h/2) j) (cos(l/2) + sin(l/2) k), with i = j k.

    Returns:
        (N, vertebrae) of each part; with one bending plane x and z are zero, and left out.
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

    Args:
        link: the length of a vertebra [m].
        parts: names of those parts of the quaternions that are not zero.
        values: these parts of each vertebra, all of the first part first.
        nanoseconds: time of the sample.
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
