"""Camera next to the bending section: JPEG pictures of an episode at a fixed rate."""

import dataclasses
import io
from collections.abc import Iterator

import numpy as np

from twin.episode import Episode
from twin.errors import InputError

QUALITY = 85
"""JPEG quality of the pictures, out of 100."""


@dataclasses.dataclass(frozen=True)
class Camera:
    """Frame rate and image size of a camera.

    Attributes:
        pictures_per_second: frame rate, above 0, at most 1000 [1 / s].
        width: image width, even, 80 to 1280 [pixels].
        height: image height, even, 120 to 1280 [pixels].
    """

    pictures_per_second: float = 10.0
    width: int = 320
    height: int = 240

    def __post_init__(self) -> None:
        """Convert the rate to a float, so that 10 and 10.0 are written alike."""
        object.__setattr__(self, "pictures_per_second", float(self.pictures_per_second))

    def check(self) -> None:
        """Refuse a rate or a size that is out of range."""
        if not 0 < self.pictures_per_second <= 1000:
            raise InputError(
                f"camera: {self.pictures_per_second:g} pictures per second: must be positive, at most 1000"
            )
        if self.width % 2 or self.height % 2 or not (80 <= self.width <= 1280 and 120 <= self.height <= 1280):
            raise InputError(
                f"camera: {self.width} x {self.height} pixels: must be even, 80 to 1280 and 120 to 1280"
            )


def pictures(episode: Episode, camera: Camera) -> Iterator[tuple[int, bytes]]:
    """Yield the sample index of each picture and the picture as a JPEG file.

    A picture shows the sample that is the latest at its time. The bytes depend on what draws them: OpenGL
    libraries differ in single pixels.
    """
    from PIL import Image

    from twin.rendering.portrait import EpisodePortrait  # a camera is described without MuJoCo

    portrait = EpisodePortrait(episode, camera.width, camera.height)
    seconds = float(episode.time[-1] - episode.time[0])
    taken = np.arange(int(seconds * camera.pictures_per_second + 1e-9) + 1) / camera.pictures_per_second
    for sample in np.unique(np.searchsorted(episode.time - episode.time[0], taken + 1e-9, side="right") - 1):
        buffer = io.BytesIO()
        Image.fromarray(portrait.picture(int(sample))).save(buffer, "JPEG", quality=QUALITY)
        yield int(sample), buffer.getvalue()
