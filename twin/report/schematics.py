"""The paper's schematic figures, 1 to 4, drawn from a run: its endoscope, filter and policies."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from numpy.typing import NDArray

from twin.episode import Episode
from twin.estimation.learned.direct import DirectEstimator
from twin.estimation.learned.ram import ReinforcementActiveModel
from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset
from twin.report.blocks import Block, Flow, block_diagram
from twin.report.figures import INK, MUTED

Array = NDArray[np.float64]
THETA, DELTA, PHI = "\u03b8", "\u03b4", "\u03c6"  # Greek letters
WIRE_A, WIRE_B = "#a8231c", "#2b6ca3"
SHAFT = 12.0
"""Length of the shaft that is drawn below the bending section [mm]."""


def bending_schematic(preset: Preset, episode: Episode) -> Figure:
    """Draw the endoscope straight and at the largest bend of a record, true to scale (the paper's Fig. 1).

    Args:
        preset: of the record.
        episode: simulated; its hinges give the poses.
    """
    place = int(np.abs(episode.bend).argmax())
    figure = Figure(figsize=(6.6, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_axis_off()
    link, offset = 1e3 * preset.section_length / preset.vertebrae, 1e3 * preset.wire_offset
    poses = (np.zeros(preset.vertebrae), _each_hinge(episode.joint_angle[place], preset.vertebrae))
    middle, turned = _middle(poses[1], link)
    for hinges, ghost in zip(poses, (True, False), strict=True):
        points, turns = _middle(hinges, link)
        for side, colour in ((-1, WIRE_B), (1, WIRE_A)):
            wire = points + side * offset * np.stack([np.cos(turns), -np.sin(turns)], axis=-1)
            wire = np.vstack([[side * offset, -SHAFT], wire])
            axes.plot(
                *wire.T,
                color=colour,
                linewidth=1.0 if ghost else 1.8,
                alpha=0.35 if ghost else 1.0,
                linestyle=(0, (4, 2)) if side < 0 else "-",
            )
        axes.plot(*points.T, "o", color=INK, markersize=2.0, alpha=0.3 if ghost else 1.0)
        axes.plot([0, 0], [-SHAFT, 0], color="#b8bfc8", linewidth=11, solid_capstyle="butt", zorder=0)
    _mark_angle(axes, middle[-1], turned[-1], link)
    pull = float(episode.pull_mm[place])
    drawn_in, way = ("a", 1.0) if pull >= 0 else ("b", -1.0)
    start = (way * offset, -SHAFT)
    axes.annotate(
        "",
        (start[0], start[1] - 8),
        (start[0], start[1] - 0.4),
        arrowprops={"arrowstyle": "-|>", "color": INK},
    )
    said = f"{DELTA}l = {abs(pull):.2f} mm: the pulley\ndraws wire {drawn_in} in"
    axes.text(start[0] + 3 * way, start[1] - 5, said, color=INK, **_text(way))
    axes.text(-way * (offset + 3), -SHAFT / 2, "shaft", color=MUTED, **_text(-way))
    leans = np.sign(middle[-1, 0]) or 1.0
    length = 1e3 * preset.section_length
    section = f"bending section of {length:g} mm,\n{preset.vertebrae} hinges"
    axes.text(-leans * (offset + 3), 0.6 * length, section, color=MUTED, **_text(-leans))
    for name, colour, line in (("wire a", WIRE_A, "-"), ("wire b", WIRE_B, (0, (4, 2)))):
        axes.plot([], [], color=colour, linewidth=1.8, linestyle=line, label=name)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left" if leans > 0 else "lower right")
    axes.set_ylim(-SHAFT - 9, 1.2 * length)
    axes.set_xlim(*sorted((-leans * 32, leans * 62)))
    return figure


def platform_schematic(preset: Preset, sample_time_s: float) -> Figure:
    """Draw the blocks of the platform as the twin has them, with their numbers (the paper's Fig. 3)."""
    computer = ("estimator or controller", f"a sample each {sample_time_s:g} s")
    drive = [f"pulley of {1e3 * preset.pulley_radius:g} mm", f"backlash {1e3 * preset.backlash:g} mm"]
    sheath = (
        f"{1e3 * preset.sheath_length:g} mm, bent by {np.degrees(preset.sheath_bend):.0f} deg",
        f"{preset.wires} wires, {preset.sheath_elements} elements of friction each",
    )
    section = (
        f"{1e3 * preset.section_length:g} mm, {preset.vertebrae} hinges",
        f"{preset.section_stiffness:.3g} N m / rad",
    )
    blocks = {
        "computer": Block("Computer", computer, (0.95, 0.8), 1.8),
        "drive": Block("Motor and gear", tuple(drive), (3.5, 0.8), 1.6),
        "sheath": Block("Wires in the sheath", sheath, (6.2, 0.8), 2.5),
        "section": Block("Bending section", section, (6.2, 2.3), 2.5),
        "sensor": Block("Angle sensor", _sensor_lines(preset), (3.5, 2.3), 1.7),
        "record": Block("Recording", ("MCAP: command, truth,", "measurement, tension"), (0.95, 2.3), 1.8),
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


def ram_schematic(model: ColemanHodgdon, training: Mapping[str, str]) -> Figure:
    """Draw the blocks of RAM, its model, and what its policy sees and says (the paper's Fig. 2).

    Args:
        model: the reference model of the run.
        training: names and values of the filter's configuration: `T`, `Q`.
    """
    a, b, c = (float(np.asarray(of)) for of in (model.a_per_mm, model.b_deg_per_mm, model.c_deg_per_mm))
    sensed, unit = next(iter(ReinforcementActiveModel.sensed.items()))
    gains = ReinforcementActiveModel.applied
    policy = (f"sees {sensed.replace('phi', PHI)} / {unit}", *(f"says {name}" for name in gains))
    blocks = {
        "model": Block(
            "Coleman-Hodgdon model (eq. 1)",
            (
                f"a = {a:.3g} / mm",
                f"b = {b:.4g}, c = {c:.3g} deg / mm",
            ),
            (1.5, 0.75),
            2.5,
        ),
        "filter": Block(
            "Active model (EKF, eqs. 4-9)",
            ("X = [angle, error of the model]", *(f"{name} = {value}" for name, value in training.items())),
            (4.9, 0.75),
            2.4,
        ),
        "residual": Block("Residual", (f"{PHI} = y \N{MINUS SIGN} its updated angle",), (4.9, 2.15), 2.4),
        "policy": Block("Policy (PPO)", policy, (1.5, 2.15), 2.5, shaded=True),
        "sum": Block("Estimate (eq. 10)", (f"X = X of the filter + K {PHI}",), (3.2, 3.35), 2.4),
    }
    flows = (
        Flow((0.02, 0.12), "model", f"command {DELTA}l", ((1.5, 0.12),), (0.75, 0.03)),
        Flow("model", "filter", "prediction"),
        Flow((7.45, 2.15), "residual", "measurement y", label_at=(6.98, 2.05)),
        Flow((7.45, 0.65), (6.1, 0.65), "measurement y", label_at=(6.98, 0.55)),
        Flow("filter", "residual", "X of the filter"),
        Flow("residual", "policy", PHI),
        Flow("policy", "sum", "K of RAM", ((1.5, 3.35),), (1.57, 2.95)),
        Flow("residual", "sum", PHI, ((4.9, 3.35),), (4.97, 2.85)),
        Flow(
            "sum",
            (6.1, 0.95),
            "X of RAM feeds the next prediction",
            ((3.2, 3.8), (6.45, 3.8), (6.45, 0.95)),
            (4.9, 3.9),
        ),
    )
    return block_diagram(blocks, flows, (7.5, 4.0))


def direct_schematic() -> Figure:
    """Draw the blocks of direct RL: a policy in the place of model and filter (the paper's Fig. 4)."""
    sees = tuple(f"{name} [{unit}]" for name, unit in DirectEstimator.sensed.items())
    says, unit = next(iter(DirectEstimator.applied.items()))
    blocks = {
        "seen": Block("What it sees", sees, (1.5, 0.75), 2.2),
        "policy": Block("Policy (PPO)", (f"says the {says} [{unit}]",), (4.1, 0.75), 2.0, shaded=True),
        "estimate": Block("Estimate", ("angle before + its change",), (6.5, 0.75), 1.8),
    }
    flows = (
        Flow((0.0, 0.75), "seen"),
        Flow("seen", "policy"),
        Flow("policy", "estimate"),
        Flow("estimate", "seen", "the last estimate", ((6.5, 1.5), (1.5, 1.5))),
    )
    return block_diagram(blocks, flows, (7.5, 1.75))


def _sensor_lines(preset: Preset) -> tuple[str, ...]:
    lines = []
    if preset.sensor_noise:
        lines.append(f"noise {np.degrees(preset.sensor_noise):.2g} deg")
    if preset.sensor_latency:
        lines.append(f"late by {preset.sensor_latency:g} s")
    return tuple(lines) or ("noise is drawn by the test",)


def _each_hinge(angles: Array, hinges: int) -> Array:
    """Angles of all hinges: neighbours that the twin moves as one group share theirs."""
    if len(angles) == hinges:
        return angles
    return np.full(hinges, float(angles.sum()) / hinges)


def _middle(hinges: Array, link: float) -> tuple[Array, Array]:
    """(n + 1, 2) places of hinges and tip [mm], and (n + 1,) directions there [rad]."""
    turned = np.concatenate([[0.0], np.cumsum(hinges)])
    steps = link * np.stack([np.sin(turned[1:]), np.cos(turned[1:])], axis=-1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), turned


def _mark_angle(axes: Axes, tip: Array, direction: float, link: float) -> None:
    """Mark the angle between the direction of the shaft and that of the tip."""
    length = 4.5 * link
    ahead = tip + length * np.array([0.0, 1.0])
    along = tip + length * np.array([np.sin(direction), np.cos(direction)])
    axes.plot(*np.array([tip, ahead]).T, color=MUTED, linewidth=0.9, linestyle=(0, (2, 2)))
    axes.plot(*np.array([tip, along]).T, color=INK, linewidth=0.9)
    begin, end = sorted((90.0, 90.0 - np.degrees(direction)))
    axes.add_patch(Arc((tip[0], tip[1]), 1.5 * length, 1.5 * length, theta1=begin, theta2=end, color=INK))
    at = tip + 0.95 * length * np.array([np.sin(direction / 2), np.cos(direction / 2)])
    said = f"{THETA} = {np.degrees(direction):.1f} deg".replace("-", "\N{MINUS SIGN}")
    axes.text(
        at[0], at[1], said, fontsize=9.5, color=INK, ha="left" if direction > 0 else "right", va="bottom"
    )


def _text(side: float) -> dict[str, Any]:
    """Place a text to the right (1) or left (-1) of a point."""
    return {"fontsize": 8.5, "ha": "left" if side > 0 else "right", "va": "center"}
