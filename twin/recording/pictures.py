"""Pictures of cameras beside an episode, read back from its file."""

import dataclasses
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from numpy.typing import NDArray

from twin.errors import InputError
from twin.recording.camera import camera_topics
from twin.recording.contents import Contents
from twin.recording.mcap_file.records import mcap_bytes
from twin.recording.reader import HINT, one_line, whole_contents

LARGEST_SIDE = 4096
"""Width and height of a picture that is read, at most [pixels]."""


@dataclasses.dataclass(frozen=True)
class Pictures:
    """Pictures of one record, as they are in its file.

    Attributes:
        time: (M,) when each was taken, since the start of the record [s].
        jpeg: M pictures, each a JPEG file.
        size: width and height of all of them [pixels].
    """

    time: NDArray[np.float64]
    jpeg: tuple[bytes, ...]
    size: tuple[int, int]

    def at(self, time: NDArray[np.float64]) -> Iterator[NDArray[np.uint8]]:
        """Yield the latest picture (height, width, 3) at each time [s]; before the first one, the first.

        Raises:
            ValueError: one is no JPEG picture of this size.
        """
        places = np.searchsorted(self.time, time + 1e-6, side="right") - 1
        shown, picture = -1, np.empty((0, 0, 3), dtype=np.uint8)
        for place in np.maximum(places, 0).tolist():
            if place != shown:
                shown, picture = place, decoded(self.jpeg[place])
                if picture.shape != (self.size[1], self.size[0], 3):
                    raise InputError(f"picture {place} is of another size than the first one")
            yield picture


def read_pictures(path: str | Path) -> dict[str, Pictures]:
    """Read the pictures of an episode's file, by the name of the camera; none where it has none.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no MCAP file, is cut off or damaged, or its pictures are no JPEG files.
    """
    path = Path(path)
    data = mcap_bytes(path)
    topics = {name: topic for name, topic in camera_topics().items() if _names(data, topic)}
    if not topics:
        return {}
    try:
        contents = whole_contents(data, set(topics.values()))
    except ValueError as error:
        raise InputError(f"{path} {error}{HINT}") from error
    found = {name: _of(contents, topic, path) for name, topic in topics.items()}
    return {name: pictures for name, pictures in found.items() if pictures is not None}


def has_pictures(path: Path) -> bool:
    """Return whether a file holds pictures of a camera."""
    data = path.read_bytes()
    return any(_names(data, topic) for topic in camera_topics().values())


def _names(data: bytes, topic: str) -> bool:
    return topic.encode() in data  # in the channel's record, which is never compressed


def _of(contents: Contents, topic: str, path: Path) -> Pictures | None:
    """Return the pictures on one topic.

    Raises:
        ValueError: one is no JPEG file.
    """
    try:
        times, payloads = contents.times.get(topic, []), contents.payloads.get(topic, [])
        if not payloads:
            return None
        contents.check_schema(topic, CompressedImage)
        jpeg = tuple(CompressedImage.FromString(payload).data for payload in payloads)
        height, width = decoded(jpeg[0]).shape[:2]
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path} holds no whole {topic}: {one_line(error)}") from error
    return Pictures(np.array(times, dtype=float) / 1e9, jpeg, (width, height))


def decoded(jpeg: bytes) -> NDArray[np.uint8]:
    """Return a JPEG file as (height, width, 3) pixels.

    Raises:
        ValueError: it is none, or too large.
    """
    from PIL import Image  # of an extra: files are read without it

    try:
        with Image.open(io.BytesIO(jpeg), formats=("JPEG",)) as picture:
            if max(picture.size) > LARGEST_SIDE:
                raise InputError(f"a picture of {picture.size[0]} x {picture.size[1]} pixels is too large")
            pixels: NDArray[np.uint8] = np.array(picture.convert("RGB"), dtype=np.uint8)
            return pixels
    except OSError as error:
        raise InputError(f"a picture is no JPEG file: {error}") from None
