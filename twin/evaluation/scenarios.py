"""Test sets of the full comparison: which endoscopes follow which commands, and their simulated records.

Every twin of a stroke follows one of five commands, one of each kind of signal. An ensemble of twins that is
driven by those five therefore serves all of them. A published test set is recognised by its angles.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from twin.dataset.episodes import VERSIONS
from twin.episode import Episode, Record
from twin.errors import DivergedError, InputError
from twin.evaluation.protocol import RECORD_SAMPLE_TIME
from twin.files.assets import assets_folder
from twin.files.dataset_json import NAME, BenchmarkDataset, read_contents, to_json_values, write_contents
from twin.preset import Preset, Ranges, load_preset, preset_names
from twin.recording import write_episode
from twin.recording.listing import describe_episode, features_of, totals
from twin.signals.excitation import SIGNALS, command
from twin.signals.streams import SeedUse, random_stream
from twin.simulation import simulate, simulate_batch

Array = NDArray[np.float64]

SAMPLE_TIME = RECORD_SAMPLE_TIME  # [s]
STROKES_MM = ((-1.0, 1.0), (2.0, 4.0), (-4.0, 4.0))
RANDOMIZED = 20
BENDING = (np.pi / 2, 3 * np.pi / 2)  # sheath bend at the start and at the end of a record [rad]

WIDER, WIDE = 1.5, 10  # factor of the ranges of twins that are in no training, and number of such twins
MOVES_AT, MOVES_FOR_S = 0.4, 0.5  # share of a record after which the sheath moves suddenly, and duration [s]
TOUCHED, TOUCH_N = (0.3, 0.7), 0.1  # shares of a record between which the tip is touched, and the force [N]
FARTHER = 2.5  # factor of the widest stroke for another endoscope: `vio_com` does not bend below some mm

FINGERPRINT_FILE = "frozen_test_set.json"
TOLERANCE_DEG = 0.05
"""Largest difference of an angle to the published one: another processor rounds otherwise."""


@dataclasses.dataclass(frozen=True)
class Scenario:
    """Endoscope and command of one record."""

    twin: str  # kind of twin: `nominal`, `randomized`, `bending sheath`, `member` of an ensemble,
    preset: Preset  # the endoscope
    signal: str  # kind of command
    stroke_mm: tuple[float, float]  # lowest and highest pulling distance [mm]
    pull: Array  # (N,) command [m]
    sheath_bend: Array | None = None  # (N,) where the sheath is bent during the record [rad]
    tip_force: Array | None = None  # (N,) that pushes the tip sideways, only in MuJoCo [N]


def scenarios(preset: Preset, ranges: Ranges, seconds: float, seed: int) -> list[Scenario]:
    """Return the test records of the suite `full`, stroke by stroke."""
    twins = [ranges.draw(preset, random_stream(seed, SeedUse.BENCHMARK_TWINS, k)) for k in range(RANDOMIZED)]
    drives = []
    for stroke in STROKES_MM:
        for place, (signal, pull) in enumerate(commands(stroke, seconds, seed).items()):
            bend = np.linspace(*BENDING, len(pull))
            drives += [
                Scenario("nominal", preset, signal, stroke, pull),
                Scenario("bending sheath", preset, signal, stroke, pull, bend),
                *(Scenario("randomized", of, signal, stroke, pull) for of in twins[place :: len(SIGNALS)]),
            ]
    return drives


def untrained_scenarios(preset: Preset, ranges: Ranges, seconds: float, seed: int) -> list[Scenario]:
    """Return the test records of the suite `untrained`: twins that are in no training.

    On the commands of the full suite, on its narrowest and its widest stroke: the preset, for sensors that
    have a fault (`twin/signals/sensor_errors.py`); a sheath that moves by half a turn within half a second; a
    tip that is touched; twins from ranges half as wide again; and each of the other presets, pulled as far as
    a longer endoscope needs.
    """
    wide = ranges.wider(WIDER)
    twins = [wide.draw(preset, random_stream(seed, SeedUse.BENCHMARK_WIDE_TWINS, k)) for k in range(WIDE)]
    drives = []
    for stroke in (STROKES_MM[0], STROKES_MM[2]):
        for place, (signal, pull) in enumerate(commands(stroke, seconds, seed).items()):
            time = np.arange(len(pull)) * SAMPLE_TIME
            moved = np.interp(time, np.array([0, MOVES_FOR_S]) + MOVES_AT * seconds, BENDING)
            touched = TOUCH_N * ((time >= TOUCHED[0] * seconds) & (time < TOUCHED[1] * seconds))
            drives += [
                Scenario("nominal", preset, signal, stroke, pull),
                Scenario("sheath moves suddenly", preset, signal, stroke, pull, moved),
                Scenario("tip touched", preset, signal, stroke, pull, tip_force=touched.astype(float)),
                *(Scenario("wider ranges", of, signal, stroke, pull) for of in twins[place :: len(SIGNALS)]),
            ]
    farther = (FARTHER * STROKES_MM[2][0], FARTHER * STROKES_MM[2][1])
    drives += [
        Scenario("another endoscope", load_preset(name), signal, farther, FARTHER * pull)
        for name in preset_names()
        if name != preset.name
        for signal, pull in commands(STROKES_MM[2], seconds, seed).items()
    ]
    return drives


def commands(stroke_mm: tuple[float, float], seconds: float, seed: int) -> dict[str, Array]:
    """Return one command (N,) [m] of each kind of signal on a stroke."""
    low, high = stroke_mm[0] * 1e-3, stroke_mm[1] * 1e-3
    place = STROKES_MM.index(stroke_mm)
    drawn = {}
    for number, signal in enumerate(SIGNALS):
        rng = random_stream(seed, SeedUse.BENCHMARK_COMMANDS, place, number)
        drawn[signal] = command(signal, (low, high), seconds, SAMPLE_TIME, rng)
    return drawn


def members(
    preset: Preset, ranges: Ranges, pull: Array, count: int, seed: int, first: int = 0
) -> list[Scenario]:
    """Return the drives of an ensemble along a command (N,) [m]: other draws from the ranges of the test.

    Every second one has its sheath bent on during the record, from one drawn angle to another. `first` is the
    number of the first draw, so that ensembles need have no member in common.
    """
    drives = []
    for number in range(first, first + count):
        rng = random_stream(seed, SeedUse.BENCHMARK_MEMBERS, number)
        drawn, other = ranges.draw(preset, rng), ranges.draw(preset, rng)
        bend = np.linspace(drawn.sheath_bend, other.sheath_bend, len(pull)) if number % 2 else None
        drives.append(Scenario("member", drawn, "given", (0, 0), pull, bend))
    return drives


def simulate_drives(
    drives: Sequence[Scenario], on_sample: Callable[[int, int], None] | None = None, physics: str = "mujoco"
) -> list[Episode | None]:
    """Simulate all drives in one batch, by one of the twins; None where a simulation diverged."""
    return simulate_batch(
        [drive.preset for drive in drives],
        [drive.pull for drive in drives],
        SAMPLE_TIME,
        physics=physics,
        sheath_bends=[drive.sheath_bend for drive in drives],
        on_sample=on_sample,
    )


def simulate_pushed(drive: Scenario) -> Episode:
    """Simulate a drive whose tip is pushed, in MuJoCo."""
    forces = iter([] if drive.tip_force is None else drive.tip_force.tolist())

    def push(endoscope: Any) -> None:
        endoscope.push_tip(next(forces, 0.0))

    return simulate(drive.preset, drive.pull, SAMPLE_TIME, sheath_bend=drive.sheath_bend, on_sample=push)


def simulate_all(drives: Sequence[Scenario]) -> list[Episode | None]:
    """Simulate drives of any presets in MuJoCo, with their forces; None where a simulation diverged."""
    episodes: list[Episode | None] = [None] * len(drives)
    together: dict[str, list[int]] = {}
    for place, drive in enumerate(drives):
        if drive.tip_force is None:
            together.setdefault(drive.preset.name, []).append(place)
        else:
            episodes[place] = simulate_pushed(drive)
    for places in together.values():
        for place, episode in zip(places, simulate_drives([drives[i] for i in places]), strict=True):
            episodes[place] = episode
    return episodes


def write_scenarios(
    folder: Path,
    preset: Preset,
    ranges: Ranges,
    seconds: float,
    seed: int,
    make: Callable[[Preset, Ranges, float, int], list[Scenario]] = scenarios,
) -> list[Path]:
    """Simulate the test records into a folder of MCAP files, or find those of an earlier run.

    Raises `ValueError` where the folder holds another test set, `FloatingPointError` where a simulation
    diverged. `make` returns the drives: `scenarios`, or those of another suite. The files are in their order.
    """
    folder.mkdir(parents=True, exist_ok=True)
    drives = make(preset, ranges, seconds, seed)
    paths = [folder / f"record_{number:03d}.mcap" for number in range(len(drives))]
    recipe = {
        "preset": preset.to_dict(),
        "ranges": ranges.to_dict(),
        "seconds": seconds,
        "sample_time_s": SAMPLE_TIME,
        "seed": seed,
    }
    if (folder / NAME).is_file():
        held = read_contents(folder)
        same = isinstance(held, BenchmarkDataset) and to_json_values(held.recipe) == recipe
        if not same or any(getattr(held, name) != version for name, version in VERSIONS.items()):
            raise InputError(
                f"{folder} holds the records of another benchmark: choose another `folder` or remove it"
            )
        return paths
    files = []
    for path, drive, episode in zip(paths, drives, simulate_all(drives), strict=True):
        if episode is None:
            raise DivergedError(f"the simulation of {path.name} ({drive.twin}) diverged")
        conditions = {"twin": drive.twin, "signal": drive.signal, "stroke_mm": list(drive.stroke_mm)}
        metadata = episode.metadata | conditions | {"seed": seed}
        write_episode(path, dataclasses.replace(episode, metadata=metadata))
        files.append({**describe_episode(path, episode), **conditions})
    contents = {
        "source": "benchmark",
        **VERSIONS,
        "recipe": recipe,
        **totals(files),
        "features": features_of(folder, files),
        "files": files,
    }
    write_contents(folder, contents)
    return paths


class Fingerprint(BaseModel):
    """Recipe of a published test set and angles that it is recognised by: `frozen_test_set.json`."""

    name: str  # of the test set; another one has another name
    preset: str  # packaged preset that is randomised
    seconds: float  # length of each record [s]
    seed: int  # of commands and twins
    drives_sha256: str  # SHA-256 of all that is simulated (`scripts/studies/freeze_test_set.py`)
    times_s: list[float]  # times of the angles [s]
    bends_deg: list[list[float]]  # angle of each record at these times [deg]


@functools.cache
def test_set_fingerprint() -> Fingerprint:
    """Return the published test set."""
    return Fingerprint.model_validate_json((assets_folder() / FINGERPRINT_FILE).read_bytes())


def name_of_test_set(records: Sequence[Record], sample_time: float) -> str | None:
    """Return the name of the published test set, if these records, at T [s], are all of it; else None."""
    known = test_set_fingerprint()
    if len(records) != len(known.bends_deg):
        return None
    for record, wanted in zip(records, known.bends_deg, strict=True):
        time = np.arange(len(record.time)) * sample_time
        if time[-1] < known.times_s[-1] - sample_time:
            return None
        found = np.interp(known.times_s, time, record.filled_deg)
        if np.abs(found - wanted).max() > TOLERANCE_DEG:
            return None
    return known.name
