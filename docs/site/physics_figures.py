"""Figures of docs/physics_tested.md: what the tests of the physics assert, drawn from the same simulations.

`python docs/site/physics_figures.py` writes them into docs/images/physics; it takes half a minute.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY))

from scripts.benchmarks.harness import SAMPLE_TIME, sinusoid
from scripts.benchmarks.physics import PERIOD, whole
from twin.files.atomic import write_whole
from twin.physics import simulate_batch
from twin.preset.file import load_preset
from twin.report.figures import INK, clean_axes, to_png_bytes

FOLDER = REPOSITORY / "docs/images/physics"
PRESET = load_preset("ureteroscope")
AMPLITUDE = 4e-3
COLOURS = ("#b9501f", "#2b6ca3", "#1d232c")
LINES = ("-", (0, (5, 2)), (0, (1.5, 1.5)))


def capstan() -> Figure:
    """Draw the tension that is left behind a bent sheath, against Euler's and Eytelwein's law."""
    bends = np.linspace(0, 2 * np.pi, 9)
    none = ("sheath_friction_floor", "sheath_friction_growth", "joint_friction", "routing_friction")
    bare = PRESET.replace(**dict.fromkeys(none, 0.0))
    figure, axes = _figure("bend of the sheath [deg]", "tension out / tension in")
    command = np.concatenate([np.linspace(0, 8e-3, 201), np.linspace(8e-3, 1e-3, 351)])
    for friction, colour, line in zip((0.03, 0.1, 0.2), COLOURS, LINES, strict=True):
        presets = [bare.replace(sheath_bend=float(b), sheath_friction=friction) for b in bends]
        episodes = whole(simulate_batch(presets, [command] * len(bends), SAMPLE_TIME))
        ratio = [(e.wire_tension[120:201, 0, -1] / e.wire_tension[120:201, 0, 0]).mean() for e in episodes]
        fine = np.linspace(0, 2 * np.pi, 100)
        axes.plot(np.degrees(fine), np.exp(-friction * fine), color=colour, linestyle=line, linewidth=1.2)
        label = f"\N{GREEK SMALL LETTER MU} = {friction:g}"
        axes.plot(np.degrees(bends), ratio, "o", color=colour, markersize=5, label=label)
    axes.set_xticks(range(0, 361, 90))
    axes.set_ylim(0, 1.05)
    law = "dots: twin; lines: exp(\N{MINUS SIGN}\N{GREEK SMALL LETTER MU} bend)"
    axes.legend(frameon=False, fontsize=8.5, title=law, title_fontsize=8.5)
    return figure


def rates() -> Figure:
    """Draw loops at three rates: dry friction does not know how fast it slides."""
    figure, axes = _figure("pulling distance [mm]", "bending angle [deg]")
    periods = (2.0, 8.0, 32.0)
    paths = [sinusoid(AMPLITUDE, period, 2) for period in periods]
    episodes = whole(simulate_batch([PRESET] * 3, paths, SAMPLE_TIME))
    for episode, period, colour, line in zip(episodes, periods, COLOURS, LINES, strict=True):
        second = slice(round(period / SAMPLE_TIME), None)
        loop = episode.pull_mm[second], episode.truth_deg[second]
        axes.plot(*loop, color=colour, linestyle=line, linewidth=1.4, label=f"{period:g} s a cycle")
    axes.legend(frameon=False, fontsize=8.5)
    return figure


def minor_loops() -> Figure:
    """Draw a minor loop, which closes, and what follows is as if it had never been (Madelung 1905)."""
    figure, axes = _figure("pulling distance [mm]", "bending angle [deg]")
    low, high = -0.25, 0.5
    before = np.concatenate([sinusoid(1, PERIOD, 1.25), np.linspace(1, low, 300)[1:]])
    minor = np.concatenate([np.linspace(low, high, 200)[1:], np.linspace(high, low, 200)[1:]])
    after = np.linspace(low, -1, 200)[1:]
    paths = [AMPLITUDE * np.concatenate(parts) for parts in ((before, minor, after), (before, after))]
    looped, plain = whole(simulate_batch([PRESET] * 2, paths, SAMPLE_TIME))
    axes.plot(plain.pull_mm, plain.truth_deg, color="#9aa3ad", linewidth=2.6, label="without the minor loop")
    dashed = {"color": INK, "linewidth": 1.0, "linestyle": (0, (5, 2))}
    axes.plot(looped.pull_mm, looped.truth_deg, label="with it", **dashed)
    inside = slice(len(before), len(before) + len(minor))
    small = looped.pull_mm[inside], looped.truth_deg[inside]
    axes.plot(*small, color=COLOURS[0], linewidth=1.6, label="the minor loop")
    axes.legend(frameon=False, fontsize=8.5)
    return figure


def without_friction() -> Figure:
    """Draw the same endoscope without friction: one line, no loop."""
    figure, axes = _figure("pulling distance [mm]", "bending angle [deg]")
    presets = [PRESET, PRESET.without_friction()]
    episodes = whole(simulate_batch(presets, [sinusoid(AMPLITUDE, PERIOD, 2)] * 2, SAMPLE_TIME))
    second = slice(round(PERIOD / SAMPLE_TIME), None)
    for episode, colour, line, label in zip(
        episodes, (INK, COLOURS[0]), LINES, ("with friction", "without friction"), strict=False
    ):
        axes.plot(
            episode.pull_mm[second], episode.truth_deg[second], color=colour, linestyle=line, label=label
        )
    axes.legend(frameon=False, fontsize=8.5)
    return figure


def _figure(x: str, y: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(5.0, 3.4), layout="constrained")
    axes = clean_axes(figure.subplots())
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    return figure, axes


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for draw in (capstan, rates, minor_loops, without_friction):
        write_whole(FOLDER / f"{draw.__name__}.png", to_png_bytes(draw(), 160))
        print(draw.__name__)
