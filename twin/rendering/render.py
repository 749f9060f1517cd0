"""Rendering of episodes to a frame, a picture, a contact sheet or a film, without a screen."""

from collections.abc import Callable, Sequence
from pathlib import Path

from twin.episode import Episode
from twin.errors import InputError
from twin.rendering.film import Film, render_film
from twin.rendering.look import Look
from twin.rendering.overlay import Overlay
from twin.rendering.picture import Picture
from twin.rendering.still import FORMATS, render_picture, render_sheet
from twin.rendering.video import FILMS

ENDINGS = (*FORMATS, *FILMS)  # endings of files that can be written


def render(
    episode: Episode | Overlay | Sequence[Overlay],
    path: str | Path,
    *,
    look: Look | None = None,
    time: float | None = None,
    sheet: int | None = None,
    fps: int = 25,
    speed: float = 1.0,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Draw an episode, or several side by side, as a picture or a film, by the ending of the path.

    Args:
        episode: one, an overlay with a ghost or a reference, or several overlays.
        path: a .png, .svg or .pdf, see `render_picture`, or a .mp4 or .gif, see `render_film`.
        look: camera, background, size and the like.
        time: of the pose that a picture shows, since the start [s].
        sheet: number of poses of a contact sheet, instead of a picture.
        fps: frames per second of a film.
        speed: seconds of the episode per second of a film.
        progress: see `render_film`.

    Raises:
        ValueError: the path has another ending, an option is out of range or of another kind of file, or an
            overlay has other times.
        OSError: nothing on this system can draw without a screen.
    """
    path, look = Path(path), look or Look()
    of = Overlay(episode) if isinstance(episode, Episode) else episode
    overlays = [of] if isinstance(of, Overlay) else list(of)
    ending = path.suffix.lower()
    if ending in FILMS:
        for name, value in (("time", time), ("sheet", sheet)):
            if value is not None:
                raise InputError(f"{name} = {value:g}: is of a picture, not of a film ({ending})")
        return render_film(overlays, path, look, fps=fps, speed=speed, progress=progress)
    if ending not in FORMATS:
        raise InputError(f"{path}: must end in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")
    if sheet is None:
        return render_picture(overlays, path, look, time)
    if time is not None or len(overlays) > 1:
        raise InputError(
            f"sheet = {sheet}: shows even times of one record: leave out the time and other records"
        )
    return render_sheet(overlays[0], path, sheet, look)


def render_frame(
    episode: Episode, index: int, *, width: int = 1280, height: int = 720, look: Look | None = None
) -> Picture:
    """Render one sample of an episode, (height, width, 3). For many samples, `Film` is faster."""
    if not -len(episode.time) <= index < len(episode.time):
        raise InputError(f"sample {index}: the episode has samples 0 to {len(episode.time) - 1}")
    look = look or Look(size=(width, height))
    return Film([Overlay(episode)], look).frame(index % len(episode.time))
