"""The bending section as a viewer sees it: the angle of each hinge, and a chain of frames turned by them."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from numpy.typing import NDArray

from twin.episode import Episode

Array = NDArray[np.float64]

LATERAL_HINGE = "lateral_hinge_"
"""How the names of the hinges that bend it sideways begin, in the plane of wires c and d."""


def joint_states(episode: Episode, nanoseconds: list[int]) -> Iterator[Any]:
    """Yield the angles of the hinges at each sample [rad]: `hinge_0` ..., then `lateral_hinge_0` ..."""
    names = [f"hinge_{index}" for index in range(episode.joint_angle.shape[1])]
    angles = [episode.joint_angle]
    if len(episode.lateral_joint_angle) > 0:
        names += [f"{LATERAL_HINGE}{index}" for index in range(episode.lateral_joint_angle.shape[1])]
        angles.append(episode.lateral_joint_angle)
    message = JointStates()
    joints = [message.joints.add(name=name) for name in names]
    for time, row in zip(nanoseconds, np.hstack(angles).astype(float).tolist(), strict=True):
        _stamp(message.timestamp, time)
        for joint, angle in zip(joints, row, strict=True):
            joint.position = angle
        yield message


def link_length(episode: Episode) -> float | None:
    """Return the length of one vertebra [m], or None where the metadata does not tell.

    Raises:
        ValueError: the metadata has another number of vertebrae than the joints.
    """
    preset = episode.metadata.get("preset")
    if not isinstance(preset, Mapping) or not {"section_length", "vertebrae"} <= set(preset):
        return None
    joints = episode.joint_angle.shape[1]
    if preset["vertebrae"] != joints:
        raise ValueError(f"joint_angle has {joints} columns, the preset {preset['vertebrae']} vertebrae")
    return float(preset["section_length"]) / joints


def transforms(episode: Episode, nanoseconds: list[int], link: float) -> Iterator[Any]:
    """Yield, at each sample, the frames base -> vertebra_0 -> vertebra_1 ..., a link apart [m].

    Each is turned by its hinge about (0, -1, 0) and then, in the turned frame, by its lateral hinge about
    (0, 0, 1), if there is one. The quaternion of that is
    (cos(h/2) - sin(h/2) j) (cos(l/2) + sin(l/2) k), with i = j k.
    """
    message = FrameTransforms()
    frames = []
    for index in range(episode.joint_angle.shape[1]):
        frame = message.transforms.add(child_frame_id=f"vertebra_{index}")
        frame.parent_frame_id = f"vertebra_{index - 1}" if index else "base"
        frame.translation.x = link if index else 0.0
        frames.append((frame.timestamp, frame.rotation))
    quaternions = _rotations(episode)
    rows = [parts.tolist() for parts in quaternions.values()]
    for time, *parts in zip(nanoseconds, *rows, strict=True):
        for (stamp, rotation), *values in zip(frames, *parts, strict=True):
            _stamp(stamp, time)
            for axis, value in zip(quaternions, values, strict=True):
                setattr(rotation, axis, value)
        yield message


def _rotations(episode: Episode) -> dict[str, Array]:
    """(N, vertebrae) of each part of the quaternions; with one bending plane x and z stay at their zero."""
    half = np.asarray(episode.joint_angle, dtype=float) / 2
    y, w = -np.sin(half), np.cos(half)
    if len(episode.lateral_joint_angle) == 0:
        return {"y": y, "w": w}
    half = np.asarray(episode.lateral_joint_angle, dtype=float) / 2
    sine, cosine = np.sin(half), np.cos(half)
    return {"x": y * sine, "y": y * cosine, "z": w * sine, "w": w * cosine}


def _stamp(timestamp: Any, nanoseconds: int) -> None:
    timestamp.seconds, timestamp.nanos = divmod(nanoseconds, 10**9)
