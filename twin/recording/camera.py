"""Pictures and calibrations of cameras next to an episode: their messages, and reading them back."""

import dataclasses
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from numpy.typing import NDArray

from twin.errors import InputError, needs_extra
from twin.recording.reader import named_errors, read_contents, whole_contents

CAMERA_TOPIC = "/camera/image"  # topic of the pictures of the camera next to the endoscope
STEREO_SIDES = ("left", "right")  # cameras of a stereo sensor
LARGEST_SIDE = 4096  # width and height of a picture that is read, at most [pixels]


def camera_topics() -> dict[str, str]:
    """Return the topics of the pictures of every camera, by the camera's name."""
    return {"camera": CAMERA_TOPIC} | {side: stereo_topics(side)[0] for side in STEREO_SIDES}


def stereo_topics(side: str) -> tuple[str, str]:
    """Return the topics of the pictures and of the calibration of a stereo sensor's camera."""
    return f"/camera/{side}/image", f"/camera/{side}/calibration"


def picture_message(jpeg: bytes, nanoseconds: int, frame_id: str = "camera") -> Any:
    """Return the `CompressedImage` message of one picture, a JPEG file, taken at a time [ns]."""
    message = CompressedImage(data=jpeg, format="jpeg", frame_id=frame_id)
    message.timestamp.FromNanoseconds(nanoseconds)
    return message


def calibration_message(
    size: tuple[int, int], parameters: Sequence[Sequence[float]], nanoseconds: int, frame_id: str
) -> Any:
    """Return the `CameraCalibration` message of a camera, with OpenCV's model of distortion.

    `size` is width and height of its pictures [pixels]; `parameters` are, row by row, D (5 numbers), K (9),
    R (9) and P (12), which hold from a time [ns] on.
    """
    width, height = size
    message = CameraCalibration(width=width, height=height, distortion_model="plumb_bob", frame_id=frame_id)
    for field, numbers in zip("DKRP", parameters, strict=True):
        getattr(message, field).extend(numbers)
    message.timestamp.FromNanoseconds(nanoseconds)
    return message


@dataclasses.dataclass(frozen=True)
class Pictures:
    """Pictures of one record."""

    time: NDArray[np.float64]  # (M,) when each was taken, since the start of the record [s]
    jpeg: tuple[bytes, ...]  # M pictures, each a JPEG file
    size: tuple[int, int]  # width and height of all of them [pixels]

    def at(self, time: NDArray[np.float64]) -> Iterator[NDArray[np.uint8]]:
        """Yield the latest picture (height, width, 3) at each time [s]; before the first one, the first."""
        places = np.searchsorted(self.time, time + 1e-6, side="right") - 1
        shown, picture = -1, np.empty((0, 0, 3), dtype=np.uint8)
        for place in np.maximum(places, 0).tolist():
            if place != shown:
                shown, picture = place, decoded(self.jpeg[place])
                if picture.shape != (self.size[1], self.size[0], 3):
                    raise InputError(f"picture {place} is of another size than the first one")
            yield picture


def read_pictures(path: str | Path) -> dict[str, Pictures]:
    """Read the pictures of an episode's file, by the name of the camera; none where it has none."""
    path, topics = Path(path), camera_topics()
    contents = whole_contents(path, topics.values())
    found = {}
    for name, topic in topics.items():
        if contents.payloads.get(topic):
            with named_errors(f"{path} holds no whole {topic}"):
                contents.check_schema(topic, CompressedImage)
                jpeg = tuple(CompressedImage.FromString(one).data for one in contents.payloads[topic])
                height, width = decoded(jpeg[0]).shape[:2]
                time = np.array(contents.times[topic], dtype=float) / 1e9
                found[name] = Pictures(time, jpeg, (width, height))
    return found


def has_pictures(path: Path) -> bool:
    """Return whether a file describes the pictures of a camera."""
    return bool(read_contents(path, kept=()).topics & {*camera_topics().values()})


def decoded(jpeg: bytes) -> NDArray[np.uint8]:
    """Return a JPEG file as (height, width, 3) pixels."""
    with needs_extra("a picture"):
        from PIL import Image

    try:
        with Image.open(io.BytesIO(jpeg), formats=("JPEG",)) as picture:
            if max(picture.size) > LARGEST_SIDE:
                raise InputError(f"a picture of {picture.size[0]} x {picture.size[1]} pixels is too large")
            pixels: NDArray[np.uint8] = np.array(picture.convert("RGB"), dtype=np.uint8)
            return pixels
    except OSError as error:
        raise InputError(f"a picture is no JPEG file: {error}") from None
