"""Camera messages of an episode: pictures as `CompressedImage`, calibrations as `CameraCalibration`."""

from collections.abc import Sequence
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

CAMERA_TOPIC = "/camera/image"
"""Topic of the pictures of the camera beside the endoscope."""
STEREO_SIDES = ("left", "right")
"""Cameras of a stereo sensor."""


def camera_topics() -> dict[str, str]:
    """Return the topics of the pictures of every camera, by the camera's name."""
    return {"camera": CAMERA_TOPIC} | {side: stereo_topics(side)[0] for side in STEREO_SIDES}


def stereo_topics(side: str) -> tuple[str, str]:
    """Return the topics of the pictures and of the calibration of a stereo sensor's camera."""
    return f"/camera/{side}/image", f"/camera/{side}/calibration"


def picture_message(jpeg: bytes, nanoseconds: int, frame_id: str = "camera") -> Any:
    """Return the `CompressedImage` message of one picture.

    Args:
        jpeg: the picture, as a JPEG file.
        nanoseconds: time of the picture.
        frame_id: frame of the camera.
    """
    message = CompressedImage(data=jpeg, format="jpeg", frame_id=frame_id)
    message.timestamp.FromNanoseconds(nanoseconds)
    return message


def calibration_message(
    size: tuple[int, int],
    parameters: Sequence[Sequence[float]],
    nanoseconds: int,
    frame_id: str,
) -> Any:
    """Return the `CameraCalibration` message of a camera, with OpenCV's model of distortion.

    Args:
        size: width and height of its pictures [pixels].
        parameters: row by row, D (5 numbers), K (9), R (9) and P (12).
        nanoseconds: time from which it holds.
        frame_id: frame of the camera.
    """
    width, height = size
    distortion, matrix, turn, projection = parameters
    message = CameraCalibration(
        width=width,
        height=height,
        distortion_model="plumb_bob",
        D=distortion,
        K=matrix,
        R=turn,
        P=projection,
        frame_id=frame_id,
    )
    message.timestamp.FromNanoseconds(nanoseconds)
    return message
