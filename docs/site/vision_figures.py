"""Figures of docs/vision.md: what two cameras see, and how far off the angle is that they tell.

`python docs/site/vision_figures.py` writes them into docs/images/vision; it takes two minutes.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY))

from twin.episode import Episode
from twin.files.atomic import write_whole
from twin.preset.file import load_preset
from twin.report.figures import INK, MUTED, clean_axes, to_png_bytes
from twin.signals.sensor_errors import stereo_noise
from twin.vision.rig import StereoRig
from twin.vision.sensor import StereoSensor

FOLDER = REPOSITORY / "docs/images/vision"
PRESET = load_preset("ureteroscope")
COLOURS = ("#b9501f", "#2b6ca3", "#1d232c")
SEED = np.random.SeedSequence(1)


def pair() -> Figure:
    """Draw what the left and the right camera see of one pose, sharp and as a poor rig sees it in motion."""
    poor = StereoRig(blur_px=1.1, exposure_s=0.06, pixel_noise=6.0, rolling_shutter_s=0.03, brightness=0.8)
    figure = Figure(figsize=(7.2, 5.5), layout="constrained")
    panels = figure.subplots(2, 2)
    labels = ("usual settings", "a poor camera, in motion")
    for rig, speed, row, what in zip((StereoRig(), poor), (0.0, 120.0), panels, labels, strict=True):
        record = _poses(np.array([48.0, 48.0 + speed / 10, 48.0 + speed / 5]))
        _, pictures = list(StereoSensor(PRESET, rig).pictures(record, SEED))[1]
        for axes, picture, side in zip(row, pictures, ("left", "right"), strict=True):
            axes.imshow(picture, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
            axes.set_axis_off()
            axes.set_title(f"{side}: {what}", fontsize=8, loc="left", color=INK)
    return figure


def errors() -> Figure:
    """Draw the errors over the angle, of the rigs that the benchmark's noise is drawn from."""
    figure, (over, spread) = _figure(2)
    noise = stereo_noise()
    over.axhline(0, color=MUTED, linewidth=0.6)
    for number, rig in enumerate(noise.errors_deg[:3]):
        over.plot(noise.bends_deg, rig, ".", color=COLOURS[number], markersize=1.6, alpha=0.5)
        label = f"rig {number}"
        mean = np.convolve(np.pad(rig.mean(axis=1), 2, mode="edge"), np.ones(5) / 5, "valid")
        over.plot(noise.bends_deg, mean, color=COLOURS[number], linewidth=1.3, label=label)
    over.set_xlabel("true bending angle [deg]")
    over.set_ylabel("error [deg]")
    over.set_xticks(range(-90, 91, 30))
    over.legend(frameon=False, fontsize=8, ncols=3, loc="lower center")
    over.set_ylim(-0.42, 0.36)
    spread.hist(noise.errors_deg.ravel(), bins=50, density=True, color="#c6ccd3", label="six rigs")
    at = np.linspace(-0.4, 0.4, 200)
    variance = noise.variance
    normal = np.exp(-(at**2) / 2 / variance) / np.sqrt(2 * np.pi * variance)
    spread.plot(at, normal, color=INK, linewidth=1.1, linestyle=(0, (5, 2)), label="Gaussian of this RMSE")
    spread.set_xlabel("error [deg]")
    spread.set_ylabel("density [1 / deg]")
    spread.legend(frameon=False, fontsize=8, loc="upper right")
    spread.set_ylim(0, 1.3 * float(normal.max()))
    return figure


def hidden() -> Figure:
    """Draw a record before which instruments pass: truth, what is measured, and gaps where nothing is."""
    figure, (angle, error) = _figure(2)
    time = np.arange(600) * 0.05
    record = _poses(60 * np.sin(2 * np.pi * time / 12), 0.05)
    rig = StereoRig(occlusions_per_minute=20.0)
    measured = np.degrees(StereoSensor(PRESET, rig).measure(record, SEED))
    bend = np.degrees(record.bend)
    taken = np.arange(0, 600, 2)
    lost = taken[np.isnan(measured[taken])]
    angle.plot(time, bend, color=MUTED, linewidth=1.0, label="true")
    angle.plot(time, measured, ".", color=COLOURS[1], markersize=3, label="measured")
    angle.plot(time[lost], bend[lost], "x", color=COLOURS[0], markersize=4, label="hidden: missing")
    angle.set_xlabel("time [s]")
    angle.set_ylabel("bending angle [deg]")
    angle.set_ylim(-75, 108)
    angle.legend(frameon=False, fontsize=8, ncols=3, loc="upper center")
    error.axhline(0, color=MUTED, linewidth=0.6)
    error.plot(time, measured - bend, ".", color=COLOURS[1], markersize=3)
    for one in lost:
        error.axvspan(time[one] - 0.05, time[one] + 0.05, color=COLOURS[0], alpha=0.18, linewidth=0)
    error.set_xlabel("time [s]")
    error.set_ylabel("error [deg]")
    return figure


def _poses(bend_deg: np.ndarray, sample_time: float = 0.1) -> Episode:
    """Return a record of poses that nothing simulated, bent a little more at the base."""
    count, bend = len(bend_deg), np.radians(bend_deg)
    share = 1 + 0.3 * np.linspace(1, -1, PRESET.vertebrae)
    none = np.zeros((count, 2, 0))
    hinges = bend[:, None] * share / share.sum()
    return Episode(np.arange(count) * sample_time, np.zeros(count), bend, bend, hinges, none, none)


def _figure(columns: int) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(7.6, 2.9), layout="constrained")
    return figure, [clean_axes(axes) for axes in figure.subplots(1, columns)]


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for draw in (pair, errors, hidden):
        write_whole(FOLDER / f"{draw.__name__}.png", to_png_bytes(draw(), 160))
        print(draw.__name__)
