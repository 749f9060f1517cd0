"""Samples in `assets/samples`, made by `make samples`: all simulated, with the noise of a sensor."""

import csv
import io
import json
import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.dataset.recipe import Recipe
from twin.dataset.write import write_dataset
from twin.files.assets import assets_folder
from twin.files.atomic import write_whole
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import load_ranges
from twin.preset.sensor import SensorModel
from twin.simulation import simulate

Array = NDArray[np.float64]

SAMPLE_TIME = 0.1
NOISE_DEG2 = 0.2  # variance of the noise of every sample's sensor
LOOP_BENDS_DEG = (0, 30, 90, 180)
CAMERA = SensorModel(variance_deg2=0.36, zero_deg=2.0, lag_s=0.066, rate_hz=30.0)  # that watches the bench
MISSING = 0.05  # share of its readings
SEED = 19


def make_samples(folder: Path) -> None:
    """Write all samples into a folder; what was there before is replaced."""
    generator = np.random.default_rng(SEED)
    folder.mkdir(parents=True, exist_ok=True)
    endoscope = load_ranges("ureteroscope").draw(load_preset("ureteroscope"), generator)
    for name, columns in (
        ("bench", _bench(endoscope, generator)),
        *((f"loop_{bend:03d}", _loop(np.radians(bend), generator)) for bend in LOOP_BENDS_DEG),
        ("two_planes", _two_planes(endoscope.replace(bending_planes=2), generator)),
        ("windows", _windows(endoscope, generator)),
    ):
        write_whole(folder / f"{name}.csv", _table(columns))
    write_whole(folder / "samples.jsonl", _stream(endoscope, generator))
    write_whole(folder / "bench.jsonl", _bench_stream(endoscope, generator))
    shutil.rmtree(folder / "dataset", ignore_errors=True)
    recipe = Recipe(
        load_preset("ureteroscope"), ((-1.0, 1.0),), seconds=10.0, sample_time_s=SAMPLE_TIME, episodes=2
    )
    with ThreadPoolExecutor(1) as executor:
        write_dataset(recipe, folder / "dataset", executor)


def _bench(preset: Preset, generator: np.random.Generator) -> dict[str, Array]:
    """A minute and a half of pulls over the stroke, with reversals in between, watched by a camera."""
    time = np.arange(0, 90, 1 / CAMERA.rate_hz)
    turns = (
        *((0, 0.0), (9, 3.0), (13, 1.0), (17, 2.5), (29, -3.0), (33, -1.0), (37, -2.5), (44, 1.5), (46, 0.0)),
        *((50, 3.0), (52, 2.0), (54, 2.8), (62, -2.0), (64, -1.0), (66, -3.0), (72, 2.0), (74, 2.0)),
        *((76, 0.5), (79, 2.0), (84, -1.5), (90, 0.5)),
    )
    pull = _along(time, turns)
    return {"time_s": time, "pull_mm": pull, "angle_deg": _filmed(preset, time, pull, generator)}


def _bench_stream(preset: Preset, generator: np.random.Generator) -> str:
    """Twenty seconds of a live stream at that bench."""
    time = np.arange(0, 20, 1 / CAMERA.rate_hz)
    pull = 2 * np.sin(2 * np.pi * time / 8)
    seen = _filmed(preset, time, pull, generator)
    return _json_lines(("time_s", "pull_mm", "measurement_deg"), time, pull, seen)


def _filmed(preset: Preset, time: Array, pull_mm: Array, generator: np.random.Generator) -> Array:
    """Return the angle that the camera sees (N,) [deg], NaN where it is missing."""
    bend = simulate(preset, pull_mm * 1e-3, sample_time=1 / CAMERA.rate_hz).truth_deg
    seen = np.interp(time - CAMERA.lag_s, time, bend) + CAMERA.zero_deg
    seen += generator.normal(0, np.sqrt(CAMERA.variance_deg2), len(bend))
    return np.where(generator.random(len(bend)) < MISSING, np.nan, seen)


def _loop(sheath_bend: float, generator: np.random.Generator) -> dict[str, Array]:
    """Two cycles of a triangle of the manipulator, and a smaller one within, at a bend of its sheath."""
    preset = load_preset("vio_com").replace(sheath_bend=sheath_bend)
    time = np.arange(0, 30, SAMPLE_TIME)
    turns = ((0, 0.0), (3, 60.0), (9, -60.0), (15, 60.0), (18, 0.0), (20, 40.0), (25, -60.0), (30, 40.0))
    command = _along(time, turns)
    episode = simulate(preset, np.radians(command) * preset.pulley_radius, sample_time=SAMPLE_TIME)
    return {
        "time_s": time,
        "command_deg": command,
        "angle_deg": _seen(episode.truth_deg, generator),
        "tension_a_n": episode.tension[:, 0] + generator.normal(0, 0.02, len(time)),
        "tension_b_n": episode.tension[:, 1] + generator.normal(0, 0.02, len(time)),
    }


def _two_planes(preset: Preset, generator: np.random.Generator) -> dict[str, Array]:
    """A tip that is led along circles that grow, in two planes."""
    time = np.arange(0, 30, SAMPLE_TIME)
    radius = np.minimum(time / 10, 2.0)
    pull, lateral = radius * np.cos(0.8 * time), radius * np.sin(0.8 * time)
    episode = simulate(preset, pull * 1e-3, sample_time=SAMPLE_TIME, lateral_pull=lateral * 1e-3)
    return {
        "time_s": time,
        "pull_mm": pull,
        "lateral_pull_mm": lateral,
        "angle_deg": _seen(episode.truth_deg, generator),
        "lateral_angle_deg": _seen(np.degrees(episode.lateral_bend), generator),
    }


def _windows(preset: Preset, generator: np.random.Generator) -> dict[str, Array]:
    """Six pieces of 5 s of a longer record, one below the other."""
    time = np.arange(0, 60, SAMPLE_TIME)
    pull = 2 * np.sin(2 * np.pi * time / 9) + 0.5 * np.sin(2 * np.pi * time / 2.7)
    bend = simulate(preset, pull * 1e-3, sample_time=SAMPLE_TIME).truth_deg
    window = np.floor(time / 10)
    kept = time - 10 * window < 5
    return {
        "window": window[kept],
        "time_s": (time - 10 * window)[kept],
        "command_mm": pull[kept],
        "angle_deg": _seen(bend, generator)[kept],
    }


def _stream(preset: Preset, generator: np.random.Generator) -> str:
    """Twenty seconds of a live stream, with the angle that is wanted at the next sample."""
    time = np.arange(0, 20, SAMPLE_TIME)
    pull = 0.9 * np.sin(2 * np.pi * time / 8)
    bend = simulate(preset, pull * 1e-3, sample_time=SAMPLE_TIME).truth_deg
    seen, wanted = _seen(bend, generator), 6 * np.sin(2 * np.pi * (time + SAMPLE_TIME) / 10)
    return _json_lines(("time_s", "pull_mm", "measurement_deg", "reference_deg"), time, pull, seen, wanted)


def _json_lines(names: Sequence[str], *columns: Array) -> str:
    """Return samples of a live stream, an object a line; a value that is missing is null."""
    rows = np.round(np.column_stack(columns), 4).tolist()
    known = ([None if np.isnan(value) else value for value in row] for row in rows)
    return "".join(json.dumps(dict(zip(names, row, strict=True))) + "\n" for row in known)


def _along(time: Array, turns: Sequence[tuple[float, float]]) -> Array:
    """Return a command that goes from turn to turn, (time [s], value) each, in straight lines."""
    places = np.array(turns, dtype=float)
    command: Array = np.interp(time, places[:, 0], places[:, 1])
    return command


def _seen(bend_deg: Array, generator: np.random.Generator) -> Array:
    return bend_deg + generator.normal(0, np.sqrt(NOISE_DEG2), len(bend_deg))


def _table(columns: Mapping[str, Array]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow(["" if np.isnan(value) else f"{round(value, 4):g}" for value in row])
    return text.getvalue()


if __name__ == "__main__":
    make_samples(assets_folder() / "samples")
