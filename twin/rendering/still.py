"""Picture of an episode for print: poses over one another, beside the loop or the course of the bend."""

import io
import itertools
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from twin.episode import Episode
from twin.files.atomic import write_whole
from twin.files.ours import MADE_BY
from twin.rendering.beside import NOTHING, Beside
from twin.rendering.film import Film, over, pale
from twin.rendering.loop_panel import X_LABEL as PULL_LABEL
from twin.rendering.loop_panel import loop_curves
from twin.rendering.time_panel import X_LABEL as TIME_LABEL
from twin.rendering.time_panel import time_curves
from twin.rendering.trace_panel import INK, MUTED, TRACE, Picture, draw_curves, style_axes

_POSE_COLOURS = (INK, TRACE, TRACE, INK)
_LEFT = 0.07  # margin of text in a picture, in its widths


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


def farthest_sample(episode: Episode, ghost: Episode) -> int:
    """Return the sample where the bends of two records at the same times differ most."""
    return int(np.abs(episode.bend - ghost.bend).argmax())


def render_png(episode: Episode, path: Path, *, dpi: int = 200, beside: Beside = NOTHING) -> Path:
    """Render four poses of an episode over one another, numbered, beside its loop with the same numbers.

    With a ghost, it is one pose instead, where the two differ most, before the ghost's, beside the course of
    the bends, or beside the loops where no reference is known.

    Args:
        episode: the record.
        path: the PNG to write.
        dpi: pixels per inch of a figure 9 inches wide.
        beside: what is drawn with the episode.

    Returns:
        `path`.

    Raises:
        ValueError: what is beside is not at the times of the episode.
        OSError: nothing on this system can draw without a screen.
    """
    film = Film(episode, width=1976, height=1000, beside=beside)
    figure = Figure(figsize=(9, 4.1), dpi=dpi, facecolor="white")
    poses = figure.add_axes((0.0, 0.0, 0.45, 1.0))
    if beside.ghost is None:
        samples = telling_samples(episode)
        _draw_poses(poses, film, samples)
        _draw_loop(figure.add_axes((0.56, 0.155, 0.42, 0.79)), episode, samples)
    else:
        sample = farthest_sample(episode, beside.ghost)
        _draw_pair(poses, film, beside.ghost, sample)
        _draw_courses(figure.add_axes((0.56, 0.155, 0.42, 0.75)), episode, beside, beside.ghost, sample)
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": MADE_BY})
    write_whole(path, buffer.getvalue())
    return path


def _draw_poses(axes: Axes, film: Film, samples: list[int]) -> None:
    most, upper, lower, least = (film.pose(sample) for sample in samples)
    picture = pale(np.minimum(most, least), 0.38)  # the ends of the stroke stand back
    for solid in (upper, lower):
        picture = over(solid, picture)
    _show(axes, film, picture.astype(np.uint8))
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


def _draw_pair(axes: Axes, film: Film, ghost: Episode, sample: int) -> None:
    """Draw one pose before that of the ghost, with the angle of each, and how far they are apart."""
    _show(axes, film, film.scene(sample))
    bend_deg, ghost_deg = film.episode.bend_deg[sample], ghost.bend_deg[sample]
    apart = f"{abs(bend_deg - ghost_deg):.1f}° apart at {film.episode.time[sample]:.1f} s"
    lines = (
        (f"{bend_deg:+z.1f}°", TRACE, 13, "bold"),
        (f"ghost {ghost_deg:+z.1f}°", MUTED, 9, "normal"),
        (apart, MUTED, 9, "normal"),
    )
    for row, (text, colour, size, weight) in zip((0.1, 0.155, 0.2), lines, strict=True):
        place = (_LEFT * film.width / 2, row * film.height)
        axes.text(*place, text, color=colour, fontsize=size, fontweight=weight)


def _show(axes: Axes, film: Film, picture: Picture) -> None:
    """Show a picture of the film with a scale bar."""
    axes.imshow(picture, interpolation="lanczos")
    axes.set_axis_off()
    length_mm, length = film.scale_bar()
    left, bottom = _LEFT * film.width / 2, 0.93 * film.height
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


def _draw_courses(axes: Axes, episode: Episode, beside: Beside, ghost: Episode, sample: int) -> None:
    """Draw the bends over time, or the loops where no reference is known, and mark the sample in both."""
    if beside.has_reference:
        x, label, curves = "time", TIME_LABEL, time_curves(episode, beside, moving=False)
    else:
        x, label, curves = "pull_mm", PULL_LABEL, loop_curves(episode, beside, moving=False)
    draw_curves(axes, curves, label, 0.72)
    at = [getattr(one, x)[sample] for one in (ghost, episode)]
    bends = [one.bend_deg[sample] for one in (ghost, episode)]
    axes.plot(at, bends, color=MUTED, linewidth=0.9, zorder=3)
    for place, bend, colour in zip(at, bends, (MUTED, TRACE), strict=True):
        axes.plot(place, bend, "o", color=colour, markersize=6, markeredgecolor="white", zorder=4)


def _badge(number: int) -> dict[str, Any]:
    box = {"boxstyle": "circle,pad=0.22", "facecolor": _POSE_COLOURS[number], "edgecolor": "white"}
    return {"color": "white", "fontsize": 8, "fontweight": "bold", "bbox": box}
