"""Rendering of episodes to a frame, a picture, a contact sheet or a film, without a screen."""

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from tqdm import tqdm

from twin.episode import Episode
from twin.errors import InputError
from twin.rendering.composition import Composition, Rectangle
from twin.rendering.look import Look, rgb
from twin.rendering.overlay import Overlay
from twin.rendering.picture import Label, Picture, on_paper, paint, times_real
from twin.rendering.plots import TracePanel
from twin.rendering.still import FORMATS, render_picture, render_sheet
from twin.rendering.video import FILMS, LARGEST_FRAMES, write_video

WIDTH, HEIGHT = 1280, 720
LARGEST = (3840, 2160)  # largest width and height of a frame [pixels]
_DPI = 100  # text of a film is measured by its pixels
_SAMPLED = (0.25, 0.5, 0.75, 1.0)  # shares of a GIF's length from which its colours are taken


class Film:
    """Renderer of the frames of a composition; each frame is drawn on demand."""

    def __init__(
        self, overlays: Sequence[Overlay], look: Look | None = None, speed: float | None = None
    ) -> None:
        look = look or Look()
        self.width, self.height = look.size_within((WIDTH, HEIGHT), LARGEST, even=True)
        self._theme = look.theme
        self.composition = Composition(overlays, look, self.width, self.height, dpi=_DPI)
        self._panels = [
            TracePanel(cell.plot, cell.box.width, cell.box.height, self._theme)
            for cell in self.composition.plots
        ]
        self._speed = "" if speed is None else times_real(speed)

    def frame_at(self, time: float) -> Picture:
        """Return the frame at a time since the start [s]; an episode that has ended is still."""
        return self._drawn([overlay.sample_at(time) for overlay in self.composition.overlays])

    def frame(self, index: int) -> Picture:
        """Return the frame of sample `index` of every episode, (height, width, 3)."""
        return self._drawn([index] * len(self.composition.overlays))

    def _drawn(self, samples: Sequence[int]) -> Picture:
        frame = np.empty((self.height, self.width, 3), dtype=np.uint8)
        frame[:] = rgb(self._theme.paper)

        def put(box: Rectangle, picture: Picture) -> None:
            frame[box.top : box.top + box.height, box.left : box.left + box.width] = picture

        for view in self.composition.views:
            picture = Image.fromarray(on_paper(view.scene(samples[view.number]), self._theme))
            paint(picture, view.marks(samples[view.number]))
            put(view.box, np.asarray(picture))
        for cell, panel in zip(self.composition.plots, self._panels, strict=True):
            put(cell.box, panel.draw(samples[cell.number]))
        return self._with_speed(frame) if self._speed else frame

    def _with_speed(self, frame: Picture) -> Picture:
        views, plots = self.composition.views, self.composition.plots
        box = views[-1].box if views else plots[-1].box
        if len(self.composition.overlays) == 1 and views:
            box = views[0].box
        unit = self.composition.scale_of(box) * _DPI / 100
        right = box.left + box.width - 24 * unit
        picture = Image.fromarray(frame)
        paint(picture, [Label(right, 46 * unit, self._speed, self._theme.muted, 17 * unit, anchor="rs")])
        return np.asarray(picture)


def render_film(
    overlays: Sequence[Overlay],
    path: Path,
    look: Look | None = None,
    *,
    fps: int = 25,
    speed: float = 1.0,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Render episodes side by side as a .mp4 or .gif that shows its speed, as long as the longest of them."""
    look, is_gif = look or Look(), path.suffix.lower() == ".gif"
    if look.theme.is_transparent:
        raise InputError(
            f"background = transparent: is of a picture, not of a film ({path.suffix}): white or dark"
        )
    most_fps = 50 if is_gif else 240
    if not 0 < fps <= most_fps or not 0 < speed <= 1000:
        raise InputError(f"fps {fps} and speed {speed:g}: must be positive, at most {most_fps} and 1000")
    seconds = max(overlay.seconds for overlay in overlays)
    count = int(seconds * fps / speed + 1e-9) + 1
    if count > LARGEST_FRAMES:
        raise InputError(
            f"fps {fps} and speed {speed:g}: {count} frames of {seconds:g} s, at most {LARGEST_FRAMES}"
        )
    film = Film(overlays, look, speed)

    def frames() -> Iterator[Picture]:
        bar = tqdm(total=count, desc=path.name, unit="frame", file=sys.stderr, disable=progress is not None)
        with bar:
            for drawn, time in enumerate(np.arange(count) * speed / fps, start=1):
                yield film.frame_at(float(time))
                bar.update()
                if progress is not None:
                    progress(drawn, count)

    sampled = [film.frame_at(share * seconds) for share in _SAMPLED] if is_gif else []
    write_video(path, frames(), fps, film.width, film.height, sampled)
    return path


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
