"""Rendering of an episode to a frame, a PNG or an MP4, without a screen."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from tqdm import tqdm

from twin.episode import Episode
from twin.errors import InputError
from twin.rendering.beside import NOTHING, Beside
from twin.rendering.film import HEIGHT, WIDTH, Film
from twin.rendering.still import render_png
from twin.rendering.trace_panel import Picture
from twin.rendering.video import LARGEST_FRAMES, write_video


def render(
    episode: Episode,
    path: str | Path,
    *,
    fps: int = 25,
    speed: float = 1.0,
    width: int = WIDTH,
    height: int = HEIGHT,
    beside: Beside = NOTHING,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Draw an episode as a picture or as a film, whichever the ending of the path says.

    Args:
        episode: the record.
        path: a .png to write, as `render_png` does, or a .mp4, as `render_mp4` does.
        fps: frames per second of a film.
        speed: seconds of the record per second of a film.
        width: of a film [pixels], even.
        height: of a film [pixels], even.
        beside: the record of another run to draw as a ghost, and the reference.
        progress: as of `render_mp4`.

    Returns:
        `path`.

    Raises:
        ValueError: the path has another ending, the size, `fps` or `speed` is out of range, or what is
            beside is not at the times of the episode.
        OSError: nothing on this system can draw without a screen.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending == ".png":
        return render_png(episode, path, beside=beside)
    if ending == ".mp4":
        size = {"width": width, "height": height}
        return render_mp4(episode, path, fps=fps, speed=speed, **size, beside=beside, progress=progress)
    raise InputError(f"{path}: must end in .png or .mp4")


def render_frame(episode: Episode, index: int, *, width: int = WIDTH, height: int = HEIGHT) -> Picture:
    """Render one sample of an episode, (height, width, 3). For many samples, `Film` is faster.

    Raises:
        ValueError: the size is odd or out of range, or there is no such sample.
        OSError: nothing on this system can draw without a screen.
    """
    if not -len(episode.time) <= index < len(episode.time):
        raise InputError(f"sample {index}: the episode has samples 0 to {len(episode.time) - 1}")
    return Film(episode, width, height).frame(index % len(episode.time))


def render_mp4(
    episode: Episode,
    path: Path,
    *,
    fps: int = 25,
    speed: float = 1.0,
    width: int = WIDTH,
    height: int = HEIGHT,
    beside: Beside = NOTHING,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Render an episode as a film, written whole or not at all.

    Args:
        episode: the record.
        path: the MP4 to write.
        fps: frames per second of the film.
        speed: seconds of the record per second of the film.
        width: of a frame [pixels], even.
        height: of a frame [pixels], even.
        beside: what is drawn with the episode.
        progress: called after each frame with (drawn, all); without it there is a bar on stderr.

    Returns:
        `path`.

    Raises:
        ValueError: the size, `fps` or `speed` is out of range, or what is beside is not at the times of the
            episode.
        OSError: nothing on this system can draw without a screen, or the disk is full.
    """
    if not 0 < fps <= 240 or not 0 < speed <= 1000:
        raise InputError(f"fps {fps} and speed {speed:g}: must be positive, at most 240 and 1000")
    duration = episode.time[-1] - episode.time[0]
    count = int(duration * fps / speed + 1e-9) + 1
    if count > LARGEST_FRAMES:
        raise InputError(
            f"fps {fps} and speed {speed:g}: {count} frames of {duration:g} s, at most {LARGEST_FRAMES}"
        )
    film = Film(episode, width, height, beside)
    frame_times = episode.time[0] + np.arange(count) * speed / fps
    samples = np.clip(np.searchsorted(episode.time, frame_times - 1e-9), 0, len(episode.time) - 1)

    def frames() -> Iterator[Picture]:
        with tqdm(
            total=count, desc=path.name, unit="frame", file=sys.stderr, disable=progress is not None
        ) as bar:
            for drawn, sample in enumerate(samples, start=1):
                yield film.frame(sample)
                bar.update()
                if progress is not None:
                    progress(drawn, count)

    write_video(path, frames(), fps, width, height)
    return path
