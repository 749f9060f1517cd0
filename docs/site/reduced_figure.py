"""Agreement of the reduced twin and MuJoCo's, and a figure of the record on which they differ most.

`python docs/site/reduced_figure.py` writes the figure into docs/images and prints the rows of
docs/data/reduced_agreement.csv; it takes about a minute.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY))

from scripts.benchmarks.harness import Array
from scripts.benchmarks.physics import divided, whole
from scripts.benchmarks.reduced import T
from twin.episode import Episode
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
SLOW = ("sine", "triangle", "decaying-sine")  # signals that take twice that, at an eighth of the step
LEAST_RANGE = np.radians(45)  # that a difference is a share of: some drawn endoscopes hardly move [rad]
PARTS = {1: "#b9501f", 2: "#2b6ca3", 8: INK}
"""Parts that MuJoCo's step is divided into, and their colours."""
HEADER = "preset and step,records,RMS [%],RMS of the median record [%],largest [%],released [%],tension [%]"


class Pair(NamedTuple):
    """Differences of both twins along a command, as shares of the range of MuJoCo's record."""

    preset: Preset
    pull: Array
    rms: float
    largest: float
    released: float  # of the bend before the first motion, where a curved section has been released
    tension: float


def both(presets: list[Preset], pulls: list[Array]) -> list[tuple[Episode, Episode]]:
    """Simulate MuJoCo's twin and the reduced one along commands [m]."""
    mujoco, reduced = (whole(simulate_batch(presets, pulls, T, physics=p)) for p in ("mujoco", "reduced"))
    return list(zip(mujoco, reduced, strict=True))


def compare(presets: list[Preset], pulls: list[Array]) -> list[Pair]:
    """Simulate both twins along commands [m], and return their differences."""
    return [
        Pair(preset, pull, *differences(*episodes))
        for preset, pull, episodes in zip(presets, pulls, both(presets, pulls), strict=True)
    ]


def differences(mujoco: Episode, reduced: Episode) -> tuple[float, float, float, float]:
    """Return RMS and largest difference of the bend, that before the first motion, and that of tensions."""
    away = np.abs(reduced.bend - mujoco.bend) / max(np.ptp(mujoco.bend), LEAST_RANGE)
    tension = np.abs(reduced.wire_tension - mujoco.wire_tension) / np.ptp(mujoco.wire_tension)
    first = int(np.argmax(mujoco.pull != mujoco.pull[0]))  # sample that moves
    rms = np.sqrt(np.mean(away**2))
    return float(rms), float(away[first:].max()), float(away[:first].max()), float(tension[first:].max())


def compare_all(name: str) -> list[Pair]:
    """Compare along every kind of signal: the preset, then endoscopes drawn about it."""
    rng, kinds = np.random.default_rng(0), list(SIGNALS)
    preset, ranges, stroke = load_preset(name), load_ranges(name), (-AMPLITUDE[name], AMPLITUDE[name])
    presets = [preset] * len(kinds) + [ranges.draw(preset, rng) for _ in range(PAIRS)]
    pulls = [command(kinds[k % len(kinds)], stroke, SECONDS, T, rng) for k in range(len(presets))]
    return compare(presets, pulls)


def compare_slow(name: str) -> list[Pair]:
    """Compare along slow commands, MuJoCo's at an eighth of its step."""
    rng, stroke = np.random.default_rng(1), (-AMPLITUDE[name], AMPLITUDE[name])
    pulls = [command(kind, stroke, 2 * SECONDS, T, rng) for kind in SLOW]
    return compare([divided(load_preset(name), 8)] * len(pulls), pulls)


def row(name: str, pairs: list[Pair]) -> str:
    """Return the worst of the pairs, and the median of their RMS, as a row of the file."""
    shares = 100 * np.array([pair[2:] for pair in pairs])
    rms, *others = shares.max(axis=0)
    figures = (rms, np.median(shares[:, 0]), *others)
    return ",".join([name, str(len(pairs)), *(f"{figure:.2g}" for figure in figures)])


def draw(record: Pair) -> Figure:
    """Draw both loops, and the difference at MuJoCo's step and at parts of it."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    loop, apart = (clean_axes(axes) for axes in figure.subplots(1, 2, width_ratios=(2, 3)))
    for parts, colour in PARTS.items():
        ((mujoco, reduced),) = both([divided(record.preset, parts)], [record.pull])
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
    pairs = {name: compare_all(name) for name in AMPLITUDE}
    worst = max((pair for some in pairs.values() for pair in some), key=lambda pair: pair.largest)
    write_whole(REPOSITORY / "docs/images/reduced_twin.png", to_png_bytes(draw(worst), 160))
    print(HEADER)
    for name, some in pairs.items():
        print(row(f"{name}: its own step", some))
        print(row(f"{name}: an eighth of it", compare_slow(name)))
