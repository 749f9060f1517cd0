"""Camera next to the bending section: JPEG pictures of an episode at a fixed rate."""

import dataclasses
import io
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError

QUALITY = 85  # JPEG quality of the pictures, out of 100


@dataclasses.dataclass(frozen=True)
class Camera:
    """Frame rate and image size of a camera."""

    pictures_per_second: float = 10.0  # frame rate, above 0, at most 1000 [1 / s]
    width: int = 320  # image width, even, 80 to 1280 [pixels]
    height: int = 240  # image height, even, 120 to 1280 [pixels]

    def __post_init__(self) -> None:
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


def frame_samples(time: NDArray[np.float64], frames_per_second: float) -> list[int]:
    """Return the samples of times (N,) [s] at which pictures are taken: the latest at each picture."""
    since = time - time[0]
    taken = np.arange(int(since[-1] * frames_per_second + 1e-9) + 1) / frames_per_second
    samples: list[int] = np.unique(np.searchsorted(since, taken + 1e-9, side="right") - 1).tolist()
    return samples


def pictures(episode: Episode, camera: Camera) -> Iterator[tuple[int, bytes]]:
    """Yield the sample index of each picture and the picture as a JPEG file."""
    from PIL import Image

    from twin.rendering.actor import Actor, TensionColours  # a camera is described without MuJoCo
    from twin.rendering.cameras import shot
    from twin.rendering.look import WHITE
    from twin.rendering.picture import on_paper

    actor = Actor(episode, colours=TensionColours.of(episode))
    view = shot("side", [actor], camera.width / camera.height).view
    actor.open_canvas(camera.width, camera.height)
    for sample in frame_samples(episode.time, camera.pictures_per_second):
        buffer, layer = io.BytesIO(), actor.layer(sample, view(actor, sample))
        Image.fromarray(on_paper(layer, WHITE)).save(buffer, "JPEG", quality=QUALITY)
        yield sample, buffer.getvalue()
