"""Rendering of an episode to a frame, a PNG or an MP4, without a screen."""

import io
import itertools
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tqdm import tqdm

from twin.episode import Episode
from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.ours import MADE_BY
from twin.rendering.film import HEIGHT, WIDTH, Film
from twin.rendering.loop_panel import INK, MUTED, TRACE, Picture, style_axes
from twin.rendering.video import LARGEST_FRAMES, write_video

_POSE_COLOURS = (INK, TRACE, TRACE, INK)


def render(
    episode: Episode,
    path: str | Path,
    *,
    fps: int = 25,
    speed: float = 1.0,
    width: int = WIDTH,
    height: int = HEIGHT,
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
        progress: as of `render_mp4`.

    Returns:
        `path`.

    Raises:
        ValueError: the path has another ending, or the size, `fps` or `speed` is out of range.
        OSError: nothing on this system can draw without a screen.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending == ".png":
        return render_png(episode, path)
    if ending == ".mp4":
        return render_mp4(episode, path, fps=fps, speed=speed, width=width, height=height, progress=progress)
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


def telling_samples(episode: Episode) -> list[int]:
    """Return four samples that show hysteresis: most pulled, two at one pull that differ most, least pulled.

    The two are sought in the middle of the stroke, and the more bent one comes first.
    """
    pull, bend = episode.pull, episode.bend
    strips = np.linspace(pull.min(), pull.max(), 41)
    best = (0, 0)
    for low, high in itertools.pairwise(strips[13:28]):
        inside = np.flatnonzero((pull >= low) & (pull <= high))
        if inside.size == 0:
            continue
        from_centre = np.abs(pull[inside] - (low + high) / 2)
        is_upper = bend[inside] >= (bend[inside].max() + bend[inside].min()) / 2
        upper, lower = (
            int(inside[np.where(half, from_centre, np.inf).argmin()]) for half in (is_upper, ~is_upper)
        )
        best = max(best, (upper, lower), key=lambda pair: bend[pair[0]] - bend[pair[1]])
    return [int(pull.argmax()), *best, int(pull.argmin())]


def render_png(episode: Episode, path: Path, *, dpi: int = 200) -> Path:
    """Render four poses of an episode over one another, numbered, beside its loop with the same numbers.

    Args:
        episode: the record.
        path: the PNG to write.
        dpi: pixels per inch of a figure 9 inches wide.

    Returns:
        `path`.

    Raises:
        OSError: nothing on this system can draw without a screen.
    """
    film = Film(episode, width=1976, height=1000)
    samples = telling_samples(episode)
    figure = Figure(figsize=(9, 4.1), dpi=dpi, facecolor="white")
    _draw_poses(figure.add_axes((0.0, 0.0, 0.45, 1.0)), film, samples)
    _draw_loop(figure.add_axes((0.56, 0.155, 0.42, 0.79)), episode, samples)
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": MADE_BY})
    write_whole(path, buffer.getvalue())
    return path


def render_mp4(
    episode: Episode,
    path: Path,
    *,
    fps: int = 25,
    speed: float = 1.0,
    width: int = WIDTH,
    height: int = HEIGHT,
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
        progress: called after each frame with (drawn, all); without it there is a bar on stderr.

    Returns:
        `path`.

    Raises:
        ValueError: the size, `fps` or `speed` is out of range.
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
    film = Film(episode, width, height)
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


def _draw_poses(axes: Axes, film: Film, samples: list[int]) -> None:
    most, upper, lower, least = (film.pose(sample).astype(float) for sample in samples)
    picture = 255 - 0.38 * (255 - np.minimum(most, least))  # the ends of the stroke stand back
    for solid in (upper, lower):
        cover = np.clip((255 - solid.min(axis=-1, keepdims=True)) / 25, 0, 1)
        picture = cover * solid + (1 - cover) * picture
    axes.imshow(picture.astype(np.uint8), interpolation="lanczos")
    axes.set_axis_off()
    tips = [film.tip(sample) for sample in samples]  # from the highest on the picture to the lowest
    heights = _spread([row for _, row in tips], apart=0.05 * film.height)
    for number, ((column, _), height) in enumerate(zip(tips, heights, strict=True)):
        axes.annotate(
            f"{number + 1}",
            (column + 0.05 * film.height, height),
            ha="center",
            va="center",
            **_badge(number),
        )
    length_mm, length = film.scale_bar()
    left, bottom = 0.07 * film.width / 2, 0.93 * film.height
    axes.plot([left, left + length], [bottom, bottom], color=INK, linewidth=1.4, solid_capstyle="butt")
    axes.text(left, bottom - 0.02 * film.height, f"{length_mm:g} mm", color=MUTED, fontsize=8)


def _spread(heights: list[float], apart: float) -> NDArray[np.float64]:
    """Spread increasing heights (n,) to be at least `apart`, about their common middle."""
    spread = np.array(heights, dtype=float)
    for index in range(1, len(spread)):
        spread[index] = max(spread[index], spread[index - 1] + apart)
    centred: NDArray[np.float64] = spread - (spread - heights).mean()
    return centred


def _draw_loop(axes: Axes, episode: Episode, samples: list[int]) -> None:
    pull, bend = episode.pull_mm, episode.bend_deg
    axes.plot(pull, bend, color="#9aa3ae", linewidth=1.0, solid_joinstyle="round")
    style_axes(axes, 0.72)
    upper, lower = samples[1], samples[2]
    axes.plot(pull[[upper, lower]], bend[[upper, lower]], color=TRACE, linewidth=1.4, linestyle=(0, (3, 2)))
    apart = f"{bend[upper] - bend[lower]:.1f}° apart\nat the same pull"
    axes.text(0.97, 0.06, apart, transform=axes.transAxes, ha="right", color=TRACE, fontsize=9)
    for number, sample in enumerate(samples):
        axes.text(pull[sample], bend[sample], f"{number + 1}", ha="center", va="center", **_badge(number))


def _badge(number: int) -> dict[str, Any]:
    box = {"boxstyle": "circle,pad=0.22", "facecolor": _POSE_COLOURS[number], "edgecolor": "white"}
    return {"color": "white", "fontsize": 8, "fontweight": "bold", "bbox": box}
