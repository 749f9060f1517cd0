"""The paper's schematic figures, 1 to 4, drawn from a run: its endoscope, platform, filter and policies."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, FancyArrowPatch, FancyBboxPatch
from numpy.typing import NDArray

from twin.episode import Episode
from twin.estimation.learned.direct import DirectEstimator
from twin.estimation.learned.ram import ReinforcementActiveModel
from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset
from twin.report.figures import INK, MUTED

Array = NDArray[np.float64]
Place = tuple[float, float]
"""Columns from the left and rows from the top of a diagram, each an inch."""
THETA, DELTA, PHI = "\u03b8", "\u03b4", "\u03c6"  # Greek letters
MINUS = "\N{MINUS SIGN}"
WIRES = {"wire a": (1.0, "#a8231c", "-"), "wire b": (-1.0, "#2b6ca3", (0, (4, 2)))}
"""Side, colour and line of each wire."""
SHAFT = 12.0
"""Length of the shaft that is drawn below the bending section [mm]."""
LINE_HEIGHT = 0.155
"""Height of a line of text in a block, in rows."""


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


@dataclasses.dataclass(frozen=True)
class Block:
    """Box of a diagram; `place` is its middle, `width` in columns, `shaded` what is learned."""

    title: str
    lines: tuple[str, ...]
    place: Place
    width: float = 1.7
    shaded: bool = False

    @property
    def height(self) -> float:
        """Height of the box, in rows."""
        return 0.34 + LINE_HEIGHT * len(self.lines)

    def edge(self, towards: Place) -> Place:
        """Return the middle of the side that faces a place."""
        x, y = self.place
        right, down = towards[0] - x, towards[1] - y
        if abs(right) * self.height >= abs(down) * self.width:
            return x + (self.width / 2 if right > 0 else -self.width / 2), y
        return x, y + (self.height / 2 if down > 0 else -self.height / 2)


@dataclasses.dataclass(frozen=True)
class Flow:
    """Arrow of a diagram, from a block or place to another, through places.

    The label is at the middle of its longest part, if `label_at` is not given.
    """

    begin: str | Place
    end: str | Place
    label: str = ""
    through: tuple[Place, ...] = ()
    label_at: Place | None = None


def block_diagram(blocks: Mapping[str, Block], flows: Sequence[Flow], size: Place) -> Figure:
    """Draw blocks, by name, and the arrows between them, on a grid of columns and rows."""
    figure = Figure(figsize=(size[0] * 1.02, size[1] * 1.02), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(0, size[0]), ylim=(size[1], 0), aspect="equal")
    axes.set_axis_off()
    for flow in flows:
        _draw_flow(axes, flow, blocks)
    for block in blocks.values():
        _draw_block(axes, block)
    return figure


def _draw_block(axes: Axes, block: Block) -> None:
    (x, y), height = block.place, block.height
    colour = "#f3dedc" if block.shaded else "#eef1f4"
    style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.06", "facecolor": colour}
    corner = x - block.width / 2, y - height / 2
    axes.add_patch(
        FancyBboxPatch(corner, block.width, height, edgecolor=INK, linewidth=1.0, zorder=3, **style)
    )
    middle: dict[str, Any] = {"ha": "center", "va": "center", "color": INK, "zorder": 4}
    top = y - LINE_HEIGHT * len(block.lines) / 2
    axes.text(x, top, block.title, fontsize=9, fontweight="bold", **middle)
    for number, line in enumerate(block.lines, start=1):
        axes.text(x, top + 0.02 + LINE_HEIGHT * number, line, fontsize=7.5, **middle)


def _draw_flow(axes: Axes, flow: Flow, blocks: Mapping[str, Block]) -> None:
    ends = [blocks[end].place if isinstance(end, str) else end for end in (flow.begin, flow.end)]
    path = [ends[0], *flow.through, ends[1]]
    if isinstance(flow.begin, str):
        path[0] = blocks[flow.begin].edge(path[1])
    if isinstance(flow.end, str):
        path[-1] = blocks[flow.end].edge(path[-2])
    line: dict[str, Any] = {"color": INK, "linewidth": 1.0, "zorder": 2}
    for begin, end in itertools.pairwise(path[:-1]):
        axes.plot([begin[0], end[0]], [begin[1], end[1]], **line)
    tip: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0}
    axes.add_patch(FancyArrowPatch(path[-2], path[-1], **tip, **line))
    if flow.label:
        a, b = max(itertools.pairwise(path), key=lambda of: float(np.abs(np.subtract(*of)).sum()))
        level = abs(b[0] - a[0]) > abs(b[1] - a[1])
        x, y = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
        x, y = flow.label_at or ((x, y - 0.1) if level else (x + 0.07, y))
        align = "center" if level else "left"
        axes.text(x, y, flow.label, ha=align, va="center", fontsize=7.5, color=MUTED, zorder=4)


def platform_schematic(preset: Preset, sample_time_s: float) -> Figure:
    """Draw the blocks of the platform as the twin has them, with their numbers (the paper's Fig. 3)."""
    computer = ("estimator or controller", f"a sample each {sample_time_s:g} s")
    drive = (f"pulley of {1e3 * preset.pulley_radius:g} mm", f"backlash {1e3 * preset.backlash:g} mm")
    sheath = (
        f"{1e3 * preset.sheath_length:g} mm, bent by {np.degrees(preset.sheath_bend):.0f} deg",
        f"{preset.wires} wires, {preset.sheath_elements} elements of friction each",
    )
    section = (
        f"{1e3 * preset.section_length:g} mm, {preset.vertebrae} hinges",
        f"{preset.section_stiffness:.3g} N m / rad",
    )
    sensor = [f"noise {np.degrees(preset.sensor_noise):.2g} deg"] if preset.sensor_noise else []
    sensor += [f"late by {preset.sensor_latency:g} s"] if preset.sensor_latency else []
    recording = ("MCAP: command, truth,", "measurement, tension")
    blocks = {
        "computer": Block("Computer", computer, (0.95, 0.8), 1.8),
        "drive": Block("Motor and gear", drive, (3.5, 0.8), 1.6),
        "sheath": Block("Wires in the sheath", sheath, (6.2, 0.8), 2.5),
        "section": Block("Bending section", section, (6.2, 2.3), 2.5),
        "sensor": Block("Angle sensor", tuple(sensor) or ("noise is drawn by the test",), (3.5, 2.3), 1.7),
        "record": Block("Recording", recording, (0.95, 2.3), 1.8),
    }
    flows = (
        Flow("computer", "drive", f"command {DELTA}l"),
        Flow("drive", "sheath", "pull"),
        Flow("sheath", "section", "tension"),
        Flow("section", "sensor", f"angle {THETA}"),
        Flow("sensor", "computer", "measurement y", ((3.5, 1.55), (0.95, 1.55))),
        Flow("sensor", "record"),
    )
    return block_diagram(blocks, flows, (7.5, 3.0))


def ram_schematic(model: ColemanHodgdon, settings: Mapping[str, str]) -> Figure:
    """Draw the blocks of RAM, its model, and inputs and outputs of its policy (the paper's Fig. 2).

    Args:
        model: reference model of the run.
        settings: names and values of the filter's, such as Q.
    """
    a, b, c = (float(np.asarray(of)) for of in (model.a_per_mm, model.b_deg_per_mm, model.c_deg_per_mm))
    sensed, unit = next(iter(ReinforcementActiveModel.sensed.items()))
    inputs = f"in: {sensed.replace('phi', PHI)} / {unit}"
    policy = (inputs, *(f"out: {name}" for name in ReinforcementActiveModel.applied))
    parameters = (f"a = {a:.3g} / mm", f"b = {b:.4g}, c = {c:.3g} deg / mm")
    state = ("X = [angle, error of the model]", *(f"{name} = {value}" for name, value in settings.items()))
    blocks = {
        "model": Block("Coleman-Hodgdon model (eq. 1)", parameters, (1.5, 0.75), 2.5),
        "filter": Block("Active model (EKF, eqs. 4-9)", state, (4.9, 0.75), 2.4),
        "residual": Block("Residual", (f"{PHI} = y {MINUS} its updated angle",), (4.9, 2.15), 2.4),
        "policy": Block("Policy (PPO)", policy, (1.5, 2.15), 2.5, shaded=True),
        "sum": Block("Estimate (eq. 10)", (f"X = X of the filter + K {PHI}",), (3.2, 3.35), 2.4),
    }
    feedback = ((3.2, 3.8), (6.45, 3.8), (6.45, 0.95))
    flows = (
        Flow((0.02, 0.12), "model", f"command {DELTA}l", ((1.5, 0.12),), (0.75, 0.03)),
        Flow("model", "filter", "prediction"),
        Flow((7.45, 2.15), "residual", "measurement y", label_at=(6.98, 2.05)),
        Flow((7.45, 0.65), (6.1, 0.65), "measurement y", label_at=(6.98, 0.55)),
        Flow("filter", "residual", "X of the filter"),
        Flow("residual", "policy", PHI),
        Flow("policy", "sum", "K of RAM", ((1.5, 3.35),), (1.57, 2.95)),
        Flow("residual", "sum", PHI, ((4.9, 3.35),), (4.97, 2.85)),
        Flow("sum", (6.1, 0.95), "X of RAM feeds the next prediction", feedback, (4.9, 3.9)),
    )
    return block_diagram(blocks, flows, (7.5, 4.0))


def direct_schematic() -> Figure:
    """Draw the blocks of direct RL: a policy in the place of model and filter (the paper's Fig. 4)."""
    inputs = tuple(f"{name} [{unit}]" for name, unit in DirectEstimator.sensed.items())
    output, unit = next(iter(DirectEstimator.applied.items()))
    blocks = {
        "inputs": Block("Inputs", inputs, (1.5, 0.75), 2.2),
        "policy": Block("Policy (PPO)", (f"out: {output} [{unit}]",), (4.1, 0.75), 2.0, shaded=True),
        "estimate": Block("Estimate", ("angle before + its change",), (6.5, 0.75), 1.8),
    }
    flows = (
        Flow((0.0, 0.75), "inputs"),
        Flow("inputs", "policy"),
        Flow("policy", "estimate"),
        Flow("estimate", "inputs", "the last estimate", ((6.5, 1.5), (1.5, 1.5))),
    )
    return block_diagram(blocks, flows, (7.5, 1.75))
