"""The paper's Fig. 1 drawn from an episode: the endoscope straight and bent, to scale."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from numpy.typing import NDArray

from twin.episode import Episode
from twin.preset.preset import Preset
from twin.report.figures import INK, MUTED

Array = NDArray[np.float64]
THETA, DELTA = "\u03b8", "\u03b4"  # Greek letters
MINUS = "\N{MINUS SIGN}"
WIRES = {"wire a": (1.0, "#a8231c", "-"), "wire b": (-1.0, "#2b6ca3", (0, (4, 2)))}
"""Side, colour and line of each wire."""
SHAFT = 12.0
"""Length of the shaft that is drawn below the bending section [mm]."""


def bending_schematic(preset: Preset, episode: Episode) -> Figure:
    """Draw the endoscope straight and at the largest bend of an episode, to scale (the paper's Fig. 1)."""
    place = int(np.abs(episode.bend).argmax())
    figure = Figure(figsize=(6.6, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_axis_off()
    length, offset = 1e3 * preset.section_length, 1e3 * preset.wire_offset
    link = length / preset.vertebrae
    bent = _each_hinge(episode.joint_angle[place], preset.vertebrae)
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


def _each_hinge(angles: Array, hinges: int) -> Array:
    """Angles of all hinges: neighbours that the twin moves as one group share theirs."""
    return angles if len(angles) == hinges else np.full(hinges, float(angles.sum()) / hinges)


def _chain(hinges: Array, link: float) -> tuple[Array, Array]:
    """(n + 1, 2) places of hinges and tip [mm], and (n + 1,) directions there [rad]."""
    turned = np.concatenate([[0.0], np.cumsum(hinges)])
    steps = link * np.stack([np.sin(turned[1:]), np.cos(turned[1:])], axis=-1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), turned


def _mark_angle(axes: Axes, tip: Array, direction: float, link: float) -> None:
    """Mark the angle between the direction of the shaft and that of the tip."""

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
    """Place a text to the right (1) or left (-1) of a point."""
    return {"fontsize": 8.5, "ha": "left" if side > 0 else "right", "va": "center"}
