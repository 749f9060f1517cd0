"""Messages of a stereo sensor: the calibration of each camera, and the pictures that are recorded."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from twin.episode import Episode
from twin.recording.camera import STEREO_SIDES, calibration_message, picture_message, stereo_topics
from twin.vision.calibration import StereoCalibration
from twin.vision.opencv import cv2
from twin.vision.sensor import StereoSensor

QUALITY = 92
"""JPEG quality of the pictures, out of 100."""


def calibration_messages(calibration: StereoCalibration, nanoseconds: int) -> Iterator[tuple[str, Any]]:
    """Yield topic and message of each camera's calibration.

    R turns a camera to the pair's common plane, and P projects there (OpenCV's `stereoRectify`): P of the
    right camera holds the baseline.

    Args:
        calibration: of the pair.
        nanoseconds: time from which it holds.
    """
    left, right = calibration.left, calibration.right
    size = (left.width, left.height)
    optics = left.matrix, left.distortion, right.matrix, right.distortion
    rectified = cv2.stereoRectify(*optics, size, right.rotation, right.translation.reshape(3, 1))
    for place, (side, camera) in enumerate(zip(STEREO_SIDES, (left, right), strict=True)):
        parts = camera.distortion, camera.matrix, rectified[place], rectified[place + 2]
        message = calibration_message(
            size, [np.ravel(part).tolist() for part in parts], nanoseconds, _frame(side)
        )
        yield stereo_topics(side)[1], message


def picture_messages(
    sensor: StereoSensor, episode: Episode, seed: np.random.SeedSequence, nanoseconds: list[int]
) -> Iterator[tuple[str, Any, int]]:
    """Yield topic, message and time of each picture that is recorded.

    Args:
        sensor: before the endoscope.
        episode: the record.
        seed: that it was measured with: the pictures are those that were measured.
        nanoseconds: N times of the samples.
    """
    if sensor.rig.pictures_per_second == 0:
        return
    for sample, pair in sensor.pictures(episode, seed, sensor.rig.pictures_per_second):
        for side, picture in zip(STEREO_SIDES, pair, strict=True):
            time = nanoseconds[sample]
            yield stereo_topics(side)[0], picture_message(_jpeg(picture), time, _frame(side)), time


def _frame(side: str) -> str:
    return f"camera_{side}"


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=QUALITY)
    return buffer.getvalue()
