"""Figure of docs/physics.md: the record on which the reduced twin and MuJoCo's differ most.

`python docs/site/reduced_figure.py` writes it into docs/images; it takes some three minutes.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY))

from scripts.benchmarks.harness import Array
from scripts.benchmarks.physics import whole
from scripts.benchmarks.reduced import T
from twin.files.atomic import write_whole
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import load_ranges
from twin.report.figures import INK, clean_axes, to_png_bytes
from twin.signals.excitation import SIGNALS, command
from twin.simulation import simulate_batch

AMPLITUDE = {"ureteroscope": 4e-3, "vio_com": 1e-2}
"""Of the commands to each preset [m]."""
PAIRS = 200  # drawn endoscopes, besides the preset itself along every kind of signal
SECONDS = 20.0
LEAST_RANGE = np.radians(45)  # that a difference is a share of: some drawn endoscopes hardly move [rad]
PARTS = {1: "#b9501f", 2: "#2b6ca3", 8: INK}
"""Parts that MuJoCo's step is divided into, and their colours."""


class Worst(NamedTuple):
    """Record on which both twins differ most, as a share of its range."""

    share: float
    preset: Preset
    pull: Array


def worst() -> Worst:
    """Return the worst of the records of both presets and of endoscopes drawn about them."""
    found = []
    for name, amplitude in AMPLITUDE.items():
        rng, kinds = np.random.default_rng(0), list(SIGNALS)
        preset, ranges, stroke = load_preset(name), load_ranges(name), (-amplitude, amplitude)
        presets = [preset] * len(kinds) + [ranges.draw(preset, rng) for _ in range(PAIRS)]
        pulls = [command(kinds[k % len(kinds)], stroke, SECONDS, T, rng) for k in range(len(presets))]
        made = [whole(simulate_batch(presets, pulls, T, physics=p)) for p in ("mujoco", "reduced")]
        for preset, pull, mujoco, reduced in zip(presets, pulls, *made, strict=True):
            span = max(np.ptp(mujoco.bend), LEAST_RANGE)
            found.append(Worst(float(np.abs(reduced.bend - mujoco.bend).max() / span), preset, pull))
    return max(found, key=lambda record: record.share)


def draw(record: Worst) -> Figure:
    """Draw both loops, and the difference at MuJoCo's step and at parts of it."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    loop, apart = (clean_axes(axes) for axes in figure.subplots(1, 2, width_ratios=(2, 3)))
    for parts, colour in PARTS.items():
        preset = record.preset
        finer = preset.replace(
            time_step=preset.time_step / parts, control_period=preset.control_period / parts
        )
        mujoco, reduced = (
            whole(simulate_batch([finer], [record.pull], T, physics=p))[0] for p in ("mujoco", "reduced")
        )
        label = "step h" if parts == 1 else f"h / {parts}"
        apart.plot(
            mujoco.time, reduced.truth_deg - mujoco.truth_deg, color=colour, linewidth=1.2, label=label
        )
        if parts == 1:
            loop.plot(mujoco.pull_mm, mujoco.truth_deg, color=INK, linewidth=2.6, label="MuJoCo")
            loop.plot(reduced.pull_mm, reduced.truth_deg, color=colour, linewidth=1.1, label="reduced")
    loop.set(xlabel="pull [mm]", ylabel="bend [deg]")
    apart.set(xlabel="time [s]", ylabel="reduced less MuJoCo [deg]")
    for axes in (loop, apart):
        axes.legend(frameon=False, fontsize=8.5)
    return figure


if __name__ == "__main__":
    found = worst()
    write_whole(REPOSITORY / "docs/images/reduced_twin.png", to_png_bytes(draw(found), 160))
    print(f"{found.preset.name}: {100 * found.share:.2f} % of the range")
