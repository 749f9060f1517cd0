"""Rendering of records to a frame, a picture, a contact sheet or a film, without a screen."""

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from twin.episode import Episode
from twin.errors import InputError
from twin.rendering.beside import NOTHING, Beside
from twin.rendering.composition import Record
from twin.rendering.film import Film
from twin.rendering.layers import Picture
from twin.rendering.look import Look
from twin.rendering.sheet import render_sheet
from twin.rendering.still import FORMATS, render_picture
from twin.rendering.video import FILMS, LARGEST_FRAMES, write_video

ENDINGS = (*FORMATS, *FILMS)
"""Endings of what can be written."""
_LOOKED_AT = (0.25, 0.5, 0.75, 1.0)  # shares of a GIF's length from which its colours are taken


def render(
    episode: Episode | Sequence[Record],
    path: str | Path,
    *,
    look: Look | None = None,
    beside: Beside = NOTHING,
    time: float | None = None,
    sheet: int | None = None,
    fps: int = 25,
    speed: float = 1.0,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Draw a record, or several side by side, as a picture or a film, whichever the ending of the path says.

    Args:
        episode: the record; or several, with what is beside each.
        path: a .png, .svg or .pdf, written by `render_picture`, or a .mp4 or .gif, written by `render_film`.
        look: camera, background, size and the like.
        beside: the record of another run, or a model, to draw as a ghost, and the reference.
        time: of the pose that a picture shows, since the start of the record [s].
        sheet: number of poses of a contact sheet, instead of a picture.
        fps: frames per second of a film.
        speed: seconds of the record per second of a film.
        progress: as of `render_film`.

    Returns:
        `path`.

    Raises:
        ValueError: the path has another ending, an option is out of range or of another kind of file, or what
            is beside a record is not at its times.
        OSError: nothing on this system can draw without a screen.
    """
    path, look = Path(path), look or Look()
    records = [Record(episode, beside)] if isinstance(episode, Episode) else list(episode)
    ending = path.suffix.lower()
    if ending in FILMS:
        for name, value in (("time", time), ("sheet", sheet)):
            if value is not None:
                raise InputError(f"{name} = {value:g}: is of a picture, not of a film ({ending})")
        return render_film(records, path, look, fps=fps, speed=speed, progress=progress)
    if ending not in FORMATS:
        raise InputError(f"{path}: must end in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")
    if sheet is None:
        return render_picture(records, path, look, time)
    if time is not None or len(records) > 1:
        raise InputError(
            f"sheet = {sheet}: shows even times of one record: leave out the time and other records"
        )
    return render_sheet(records[0], path, sheet, look)


def render_frame(
    episode: Episode, index: int, *, width: int = 1280, height: int = 720, look: Look | None = None
) -> Picture:
    """Render one sample of an episode, (height, width, 3). For many samples, `Film` is faster.

    Raises:
        ValueError: the size is odd or out of range, or there is no such sample.
        OSError: nothing on this system can draw without a screen.
    """
    if not -len(episode.time) <= index < len(episode.time):
        raise InputError(f"sample {index}: the episode has samples 0 to {len(episode.time) - 1}")
    look = look or Look(size=(width, height))
    return Film([Record(episode)], look).frame(index % len(episode.time))


def render_film(
    records: Sequence[Record],
    path: Path,
    look: Look | None = None,
    *,
    fps: int = 25,
    speed: float = 1.0,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Render records side by side as a film that says its speed, written whole or not at all.

    Args:
        records: what is shown; the longest says how long the film is.
        path: the .mp4 or .gif to write.
        look: options; the background must not be transparent.
        fps: frames per second of the film; of a GIF at most 50.
        speed: seconds of the record per second of the film.
        progress: called after each frame with (drawn, all); without it there is a bar on stderr.

    Returns:
        `path`.

    Raises:
        ValueError: the background, the size, `fps` or `speed` cannot be, or what is beside a record is not at
            its times.
        OSError: nothing on this system can draw without a screen, or the disk is full.
    """
    look = look or Look()
    if look.theme.is_transparent:
        raise InputError(
            f"background = transparent: is of a picture, not of a film ({path.suffix}): white or dark"
        )
    most_fps = 50 if path.suffix.lower() == ".gif" else 240
    if not 0 < fps <= most_fps or not 0 < speed <= 1000:
        raise InputError(f"fps {fps} and speed {speed:g}: must be positive, at most {most_fps} and 1000")
    duration = max(float(one.episode.time[-1] - one.episode.time[0]) for one in records)
    count = int(duration * fps / speed + 1e-9) + 1
    if count > LARGEST_FRAMES:
        raise InputError(
            f"fps {fps} and speed {speed:g}: {count} frames of {duration:g} s, at most {LARGEST_FRAMES}"
        )
    film = Film(records, look, speed)

    def frames() -> Iterator[Picture]:
        with tqdm(
            total=count, desc=path.name, unit="frame", file=sys.stderr, disable=progress is not None
        ) as bar:
            for drawn, time in enumerate(np.arange(count) * speed / fps, start=1):
                yield film.frame_at(float(time))
                bar.update()
                if progress is not None:
                    progress(drawn, count)

    looks = []
    if path.suffix.lower() == ".gif":
        looks = [film.frame_at(share * duration) for share in _LOOKED_AT]
    write_video(path, frames(), fps, film.width, film.height, looks)
    return path
