"""Pictures of each camera as a video of a LeRobot dataset: a film for each episode, a picture for each frame.

A frame that has no picture of its own shows the latest one, as LeRobot finds a picture by the time of its
frame; where pictures are rarer than samples, `sample_time` thins the samples to their rate.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.export.parts import CHUNK_FILES
from twin.recording.camera import Pictures
from twin.rendering.video import write_video

VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
SAMPLED = 20
"""Pictures of an episode that its statistics are of, at most."""
_APART = 4  # pixels in either direction between those that are counted

Array = NDArray[np.float64]


def video_key(camera: str) -> str:
    """Return the column of the pictures of a camera."""
    return f"observation.images.{camera}"


def video_feature(pictures: Pictures, per_second: int) -> dict[str, Any]:
    """Return the entry of the video in `info.json`."""
    width, height = even_size(pictures)
    return {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": per_second,
            "video.channels": 3,
            "has_audio": False,
        },
    }


def write_episode_video(
    folder: Path, key: str, number: int, episode: Episode, pictures: Pictures, per_second: int
) -> tuple[dict[str, Any], Array]:
    """Write the film of an episode, a picture for each of its samples.

    Args:
        folder: of the dataset.
        key: column of the pictures, as of `video_key`.
        number: of the episode, and so of the film.
        episode: at even samples.
        pictures: of its file.
        per_second: samples of a second.

    Returns:
        Where it is, as `meta/episodes` says it, and (pixels, 3) some of its pixels in [0, 1].

    Raises:
        ValueError: a picture is damaged.
        OSError: the disk is full or fails.
    """
    chunk, file = divmod(number, CHUNK_FILES)
    path = folder / VIDEO_PATH.format(video_key=key, chunk_index=chunk, file_index=file)
    path.parent.mkdir(parents=True, exist_ok=True)
    width, height = even_size(pictures)
    count = len(episode.time)
    counted = set(np.linspace(0, count - 1, min(count, SAMPLED)).astype(int).tolist())
    pixels: list[Array] = []

    def frames() -> Iterator[NDArray[np.uint8]]:
        for k, picture in enumerate(pictures.at(episode.time)):
            cut = picture[:height, :width]
            if k in counted:
                pixels.append(cut[::_APART, ::_APART].reshape(-1, 3) / 255)
            yield cut

    write_video(path, frames(), per_second, width, height)
    place = {
        f"videos/{key}/chunk_index": chunk,
        f"videos/{key}/file_index": file,
        f"videos/{key}/from_timestamp": 0.0,
        f"videos/{key}/to_timestamp": count / per_second,
    }
    return place, np.concatenate(pixels)


def even_size(pictures: Pictures) -> tuple[int, int]:
    """Return width and height without an odd column or row, which no film of this kind can have."""
    width, height = pictures.size
    return width - width % 2, height - height % 2


def nested(statistics: dict[str, list[float]]) -> dict[str, Any]:
    """Return statistics of three colours in the shape that LeRobot keeps them in: (3, 1, 1)."""
    return {
        name: values if name == "count" else [[[value]] for value in values]
        for name, values in statistics.items()
    }
