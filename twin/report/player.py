"""The slider over a record: endoscope and loop as SVG, and the samples that a script moves them by."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from twin.episode import Episode
from twin.report.parts import Player

Array = NDArray[np.float64]

MOST_SAMPLES = 300
"""Samples that a page holds of a record: the slider has no more places on a screen."""
HINGES = 16
"""Equal hinges of the arc that stands for an endoscope whose own were not recorded."""
SIZE = 360
"""Width and height of both drawings [SVG units]."""
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 12, 46
"""Margins of the loop [SVG units]."""


def record_player(episode: Episode, name: str) -> Player:
    """Return the slider over a record.

    Args:
        episode: simulated, or measured: its pose is then an arc.
        name: of the record, for the caption.
    """
    places = np.unique(np.linspace(0, len(episode.time) - 1, MOST_SAMPLES).round().astype(int))
    hinges = _hinges_deg(episode)[places]
    pull, bend = episode.pull_mm[places], episode.truth_deg[places]
    first = int(np.abs(bend).argmax())
    base, link = _scale(hinges)
    x, y, axes = _axes(pull, bend)
    simulated = bool(episode.joint_angle.size)
    drawn = "its hinges as simulated" if simulated else "drawn as an arc, as no hinge is measured"
    ends = (f"{values.min():.1f} to {values.max():.1f}" for values in (bend, pull))
    spans = "bending angle from {} deg over a pull from {} mm".format(*ends)
    return Player(
        pose=_pose_svg(hinges[first], base, link),
        loop=_loop_svg(x, y, axes, first),
        samples={
            "time_s": np.round(episode.time[places], 3).tolist(),
            "pull_mm": np.round(pull, 3).tolist(),
            "bend_deg": np.round(bend, 2).tolist(),
            "hinges_deg": np.round(hinges, 2).tolist(),
            "loop_x": np.round(x, 1).tolist(),
            "loop_y": np.round(y, 1).tolist(),
            "base": [round(base[0], 1), round(base[1], 1)],
            "link": round(link, 2),
            "first": first,
        },
        caption=f"{name}: the bending section ({drawn}) and its place on the loop. Move the slider: at one "
        "pull the tip is at two angles, by the way that it came.",
        alternative=f"Bending section beside its loop: {spans}; at one pull there are two angles.",
    )


def _hinges_deg(episode: Episode) -> Array:
    """(N, hinges) angle of each hinge [deg]; equal ones where they were not recorded."""
    if episode.joint_angle.size:
        return np.degrees(episode.joint_angle)
    equal: Array = np.repeat(episode.truth_deg[:, None] / HINGES, HINGES, axis=1)
    return equal


def _points(hinges_deg: Array) -> Array:
    """(..., hinges + 1, 2) places of the hinges and of the tip, in lengths of a link, y downwards."""
    turned = np.radians(np.cumsum(hinges_deg, axis=-1))
    steps = np.stack([np.sin(turned), -np.cos(turned)], axis=-1)
    return np.concatenate([np.zeros_like(steps[..., :1, :]), np.cumsum(steps, axis=-2)], axis=-2)


def _scale(hinges_deg: Array) -> tuple[tuple[float, float], float]:
    """Place of the base, and length of a link, so that every pose is inside the drawing [SVG units]."""
    points = _points(hinges_deg).reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    shaft = 0.25 * hinges_deg.shape[1]  # below the base, in links
    high[1] += shaft
    link = (SIZE - 60) / max(float((high - low).max()), 1e-9)
    middle = (low + high) / 2
    return (SIZE / 2 - link * float(middle[0]), SIZE / 2 - link * float(middle[1])), link


def _pose_svg(hinges_deg: Array, base: tuple[float, float], link: float) -> Markup:
    points = np.asarray(base) + link * _points(hinges_deg)
    body = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    shaft = f'x1="{base[0]:.1f}" y1="{base[1]:.1f}" x2="{base[0]:.1f}" y2="{SIZE}"'
    wide = 26
    strokes = (("#4a5360", wide), ("#c9d0d8", wide - 4))
    lines = [f'<line {shaft} stroke="{colour}" stroke-width="{width}"/>' for colour, width in strokes]
    lines += [
        f'<polyline class="body" points="{body}" fill="none" stroke="{colour}" stroke-width="{width}" '
        'stroke-linecap="round" stroke-linejoin="round"/>'
        for colour, width in strokes
    ]
    lines.append(
        f'<polyline class="body" points="{body}" fill="none" stroke="#4a5360" stroke-width="{wide - 8}" '
        f'stroke-dasharray="1.5 {max(link - 1.5, 1):.2f}" stroke-linejoin="round"/>'
    )
    return Markup(_svg(lines))


def _axes(pull: Array, bend: Array) -> tuple[Array, Array, list[str]]:
    """Places of the samples in the drawing of the loop, and its axes as SVG."""
    lines = []
    scaled = []
    spans = ((pull, LEFT, SIZE - RIGHT), (bend, SIZE - BOTTOM, TOP))
    for axis, (values, begin, end) in enumerate(spans):
        room = 0.06 * max(float(np.ptp(values)), 1e-9)
        low, high = float(values.min()) - room, float(values.max()) + room

        scale = (end - begin) / (high - low)
        for tick in MaxNLocator(5).tick_values(low, high):
            if not low <= tick <= high:
                continue
            at, said = begin + scale * (tick - low), f"{tick:g}".replace("-", "\N{MINUS SIGN}")
            if axis == 0:
                lines.append(
                    _grid(at, TOP, at, SIZE - BOTTOM) + _label(at, SIZE - BOTTOM + 17, said, "middle")
                )
            else:
                lines.append(_grid(LEFT, at, SIZE - RIGHT, at) + _label(LEFT - 7, at + 4, said, "end"))
        scaled.append(begin + scale * (values - low))
    lines.append(_label((LEFT + SIZE - RIGHT) / 2, SIZE - 8, "pulling distance [mm]", "middle"))
    lines.append(
        f'<text transform="translate(14 {(TOP + SIZE - BOTTOM) / 2:.0f}) rotate(-90)" text-anchor="middle">'
        "bending angle [deg]</text>"
    )
    return scaled[0], scaled[1], lines


def _loop_svg(x: Array, y: Array, axes: list[str], first: int) -> Markup:
    way = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return Markup(
        _svg(
            [
                *axes,
                f'<polyline points="{way}" fill="none" stroke="#9aa3ad" stroke-width="1.6"/>',
                '<polyline class="way" points="" fill="none" stroke="#1d232c" stroke-width="2.6"/>',
                f'<circle class="dot" cx="{x[first]:.1f}" cy="{y[first]:.1f}" r="6" fill="#a8231c"/>',
            ]
        )
    )


def _svg(lines: Sequence[str]) -> str:
    inner = "\n".join(lines)
    return f'<svg viewBox="0 0 {SIZE} {SIZE}" aria-hidden="true">{inner}</svg>'


def _grid(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" stroke="#e1e5ea" stroke-width="1"/>'


def _label(x: float, y: float, said: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{said}</text>'
