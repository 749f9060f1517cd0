"""Slider over an episode: endoscope and loop as SVG, and the samples for `assets/player.js`."""

import json
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from twin.episode import Episode
from twin.preset.preset import Preset
from twin.report.figures import INK, MUTED
from twin.report.page import captioned

Array = NDArray[np.float64]
THETA, DELTA = "\u03b8", "\u03b4"  # Greek letters
MINUS = "\N{MINUS SIGN}"
WIRES = {"wire a": (1.0, "#a8231c", "-"), "wire b": (-1.0, "#2b6ca3", (0, (4, 2)))}
"""Side, colour and line of each wire."""
SHAFT = 12.0  # length of the shaft that is drawn below the bending section [mm]
MOST_SAMPLES = 300  # samples that a page holds of an episode: the slider has no more places on a screen
HINGES = 16  # equal hinges of the arc of an endoscope whose own were not recorded
SIZE = 360  # width and height of both drawings [SVG units]
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 12, 46  # margins of the loop [SVG units]
_THICK = 26  # thickness of the endoscope [SVG units]
_CONTROLS = """
<div class="controls" hidden>
  <button type="button">Play</button>
  <input type="range" min="0" max="{last}" value="{first}" aria-label="Time in the record">
  <output></output>
</div>
<script type="application/json">{samples}</script>"""


def bending_schematic(preset: Preset, episode: Episode) -> Figure:
    """Draw the endoscope straight and at the largest bend of an episode, to scale (the paper's Fig. 1)."""
    place = int(np.abs(episode.bend).argmax())
    figure = Figure(figsize=(6.6, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_axis_off()
    length, offset = 1e3 * preset.section_length, 1e3 * preset.wire_offset
    link = length / preset.vertebrae
    bent = episode.joint_angle[place]
    if len(bent) != preset.vertebrae:  # neighbours that the twin moves as one group share their angle
        bent = np.full(preset.vertebrae, float(bent.sum()) / preset.vertebrae)
    for hinges, alpha in ((np.zeros(preset.vertebrae), 0.35), (bent, 1.0)):
        points, turned = _chain(hinges, link)
        for side, colour, line in WIRES.values():
            wire = points + side * offset * np.stack([np.cos(turned), -np.sin(turned)], axis=-1)
            wire = np.vstack([[side * offset, -SHAFT], wire])
            width = 1.8 if alpha == 1.0 else 1.0
            axes.plot(*wire.T, color=colour, linewidth=width, alpha=alpha, linestyle=line)
        axes.plot(*points.T, "o", color=INK, markersize=2.0, alpha=alpha)
    axes.plot([0, 0], [-SHAFT, 0], color="#b8bfc8", linewidth=11, solid_capstyle="butt", zorder=0)
    _mark_angle(axes, points[-1], turned[-1], link)
    pull = float(episode.pull_mm[place])
    name, side = ("a", 1.0) if pull >= 0 else ("b", -1.0)
    start, arrow = (side * offset, -SHAFT - 0.4), {"arrowstyle": "-|>", "color": INK}
    axes.annotate("", (start[0], -SHAFT - 8), start, arrowprops=arrow)
    drawn = f"{DELTA}l = {abs(pull):.2f} mm: the pulley\ndraws wire {name} in"
    axes.text(start[0] + 3 * side, -SHAFT - 5, drawn, color=INK, **_text(side))
    axes.text(-side * (offset + 3), -SHAFT / 2, "shaft", color=MUTED, **_text(-side))
    leans = np.sign(points[-1, 0]) or 1.0
    section = f"bending section of {length:g} mm,\n{preset.vertebrae} hinges"
    axes.text(-leans * (offset + 3), 0.6 * length, section, color=MUTED, **_text(-leans))
    for name, (_, colour, line) in WIRES.items():
        axes.plot([], [], color=colour, linewidth=1.8, linestyle=line, label=name)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left" if leans > 0 else "lower right")
    axes.set_ylim(-SHAFT - 9, 1.2 * length)
    axes.set_xlim(*sorted((-leans * 32, leans * 62)))
    return figure


def _chain(hinges: Array, link: float) -> tuple[Array, Array]:
    """(n + 1, 2) places of hinges and tip [mm], and (n + 1,) directions there [rad]."""
    turned = np.concatenate([[0.0], np.cumsum(hinges)])
    steps = link * np.stack([np.sin(turned[1:]), np.cos(turned[1:])], axis=-1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), turned


def _mark_angle(axes: Axes, tip: Array, direction: float, link: float) -> None:

    def along(angle: float) -> Array:
        return np.array([np.sin(angle), np.cos(angle)])

    size = 4.5 * link
    axes.plot(*np.array([tip, tip + size * along(0.0)]).T, color=MUTED, linewidth=0.9, linestyle=(0, (2, 2)))
    axes.plot(*np.array([tip, tip + size * along(direction)]).T, color=INK, linewidth=0.9)
    begin, end = sorted((90.0, 90.0 - np.degrees(direction)))
    axes.add_patch(Arc((tip[0], tip[1]), 1.5 * size, 1.5 * size, theta1=begin, theta2=end, color=INK))
    x, y = tip + 0.95 * size * along(direction / 2)
    label = f"{THETA} = {np.degrees(direction):.1f} deg".replace("-", MINUS)
    axes.text(x, y, label, fontsize=9.5, color=INK, ha="left" if direction > 0 else "right", va="bottom")


def _text(side: float) -> dict[str, Any]:
    return {"fontsize": 8.5, "ha": "left" if side > 0 else "right", "va": "center"}


def player(episode: Episode, name: str) -> Markup:
    """Return the slider over an episode as a part of a page; a measured one is drawn as an arc."""
    places = np.unique(np.linspace(0, len(episode.time) - 1, MOST_SAMPLES).round().astype(int))
    simulated = bool(episode.joint_angle.size)
    pull, bend = episode.pull_mm[places], episode.truth_deg[places]
    hinges = (
        np.degrees(episode.joint_angle)[places] if simulated else np.repeat(bend[:, None] / HINGES, HINGES, 1)
    )
    first = int(np.abs(bend).argmax())
    base, link = _scale(hinges)
    x, y, axes = _axes(pull, bend)
    values = {"time_s": (episode.time[places], 3), "pull_mm": (pull, 3), "bend_deg": (bend, 2)}
    values |= {"hinges_deg": (hinges, 2), "loop_x": (x, 1), "loop_y": (y, 1), "base": (base, 1)}
    samples: dict[str, Any] = {name: np.round(*of).tolist() for name, of in values.items()}
    samples |= {"link": round(link, 2), "first": first}
    drawn = "its hinges as simulated" if simulated else "drawn as an arc, as no hinge is measured"
    ends = (f"{values.min():.1f} to {values.max():.1f}" for values in (bend, pull))
    spans = "bending angle from {} deg over a pull from {} mm".format(*ends)
    alternative = f"Bending section and its loop: {spans}; at one pull there are two angles."
    drawings = Markup('<div class="pair" role="img" aria-label="{}">\n{}\n{}</div>').format(
        alternative, _pose_svg(hinges[first], base, link), _loop_svg(x, y, axes, first)
    )
    data = Markup(json.dumps(samples))  # numbers alone
    controls = Markup(_CONTROLS).format(last=len(places) - 1, first=first, samples=data)
    caption = f"{name}: the bending section ({drawn}) and its place on the loop."
    return captioned(drawings + controls, caption, "player")


def _points(hinges_deg: Array) -> Array:
    """(..., hinges + 1, 2) places of the hinges and of the tip, in lengths of a link, y downwards."""
    turned = np.radians(np.cumsum(hinges_deg, axis=-1))
    steps = np.stack([np.sin(turned), -np.cos(turned)], axis=-1)
    return np.concatenate([np.zeros_like(steps[..., :1, :]), np.cumsum(steps, axis=-2)], axis=-2)


def _scale(hinges_deg: Array) -> tuple[Array, float]:
    """Place of the base (2,), and length of a link, so that every pose is inside the drawing [SVG units]."""
    points = _points(hinges_deg).reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    high[1] += 0.25 * hinges_deg.shape[1]  # the shaft below the base
    link = (SIZE - 60) / max(float((high - low).max()), 1e-9)
    return SIZE / 2 - link * (low + high) / 2, link


def _pose_svg(hinges_deg: Array, base: Array, link: float) -> Markup:
    body = " ".join(f"{x:.1f},{y:.1f}" for x, y in base + link * _points(hinges_deg))
    shaft = f'x1="{base[0]:.1f}" y1="{base[1]:.1f}" x2="{base[0]:.1f}" y2="{SIZE}"'
    line = f'<polyline class="body" points="{body}" fill="none" stroke-linejoin="round" '
    looks = {"#4a5360": _THICK, "#c9d0d8": _THICK - 4}
    strokes = [f'stroke="{colour}" stroke-width="{width}"' for colour, width in looks.items()]
    lines = [f"<line {shaft} {stroke}/>" for stroke in strokes]
    lines += [f'{line}{stroke} stroke-linecap="round"/>' for stroke in strokes]
    dashes = f'stroke-dasharray="1.5 {max(link - 1.5, 1):.2f}"'
    lines.append(f'{line}stroke="#4a5360" stroke-width="{_THICK - 8}" {dashes}/>')
    return _svg(lines)


def _axes(pull: Array, bend: Array) -> tuple[Array, Array, list[str]]:
    lines, scaled = [], []
    for axis, (values, begin, end) in enumerate(((pull, LEFT, SIZE - RIGHT), (bend, SIZE - BOTTOM, TOP))):
        room = 0.06 * max(float(np.ptp(values)), 1e-9)
        low, high = float(values.min()) - room, float(values.max()) + room
        scale = (end - begin) / (high - low)
        scaled.append(begin + scale * (values - low))
        for tick in MaxNLocator(5).tick_values(low, high):
            if low <= tick <= high:
                at, label = begin + scale * (tick - low), f"{tick:g}".replace("-", MINUS)
                if axis == 0:
                    grid = f"M{at:.1f} {TOP}L{at:.1f} {SIZE - BOTTOM}"
                    lines.append(_label(at, SIZE - BOTTOM + 17, label, "middle"))
                else:
                    grid = f"M{LEFT} {at:.1f}L{SIZE - RIGHT} {at:.1f}"
                    lines.append(_label(LEFT - 7, at + 4, label, "end"))
                lines.append(f'<path d="{grid}" stroke="#e1e5ea" stroke-width="1"/>')
    lines.append(_label((LEFT + SIZE - RIGHT) / 2, SIZE - 8, "pulling distance [mm]", "middle"))
    upright = f'transform="translate(14 {(TOP + SIZE - BOTTOM) / 2:.0f}) rotate(-90)" text-anchor="middle"'
    lines.append(f"<text {upright}>bending angle [deg]</text>")
    return scaled[0], scaled[1], lines


def _label(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'


def _loop_svg(x: Array, y: Array, axes: list[str], first: int) -> Markup:
    path = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    loop = f'<polyline points="{path}" fill="none" stroke="#9aa3ad" stroke-width="1.6"/>'
    trace = '<polyline class="trace" points="" fill="none" stroke="#1d232c" stroke-width="2.6"/>'
    dot = f'<circle class="dot" cx="{x[first]:.1f}" cy="{y[first]:.1f}" r="6" fill="#a8231c"/>'
    return _svg([*axes, loop, trace, dot])


def _svg(lines: list[str]) -> Markup:
    inner = "\n".join(lines)
    return Markup(f'<svg viewBox="0 0 {SIZE} {SIZE}" aria-hidden="true">{inner}</svg>')
