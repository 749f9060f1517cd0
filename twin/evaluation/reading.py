"""Records from the folders that a verb is given, at one sample time, and the noise of their sensor.

A measured log may have missing samples and gaps; each function states how it treats them.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode, Record, runs_of_true
from twin.errors import InputError
from twin.files.yaml_text import parse_yaml
from twin.recording import episode_files, read_dataset, read_episode, read_metadata
from twin.signals.noise import noise_variance
from twin.signals.sensor_errors import STEREO

Array = NDArray[np.float64]

STILL_MM = 1e-9  # largest movement of a command at rest: hysteresis cannot be identified from it
MEASUREMENTS = ("auto", "drawn", "recorded")  # choices of what estimators get
DEFAULT_VARIANCE = 0.1  # R of an unknown sensor: that of the paper's training [deg^2]


def read_episodes(paths: Sequence[Path], sample_time: float) -> list[Episode]:
    """Read all episodes of folders and files at one sample time, simulated ones thinned, others interpolated.

    `measured_bend` is NaN where a measurement is missing, or a measured log has a gap.
    """
    episodes = [episode for path in paths for episode in read_dataset(path, hidden=False)]
    return [episode.resampled(sample_time) for episode in episodes]


def true_records(paths: Sequence[Path], sample_time: float) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, truth_deg)` of each episode, to train on; errors as in `read_episodes`.

    Where the angle of a measured log is not known, it is linear between its neighbours.
    """
    return [(episode.pull_mm, episode.truth_deg) for episode in read_episodes(paths, sample_time)]


def evaluation_records(paths: Sequence[Path], sample_time: float) -> list[Record]:
    """Return test records: each episode from its first known angle on; errors as in `read_episodes`.

    The truth of a simulated episode is known throughout; that of a measured log, where it was measured.
    """
    episodes = read_episodes(paths, sample_time)
    return [evaluation_record(episode, number) for number, episode in enumerate(episodes)]


def evaluation_record(episode: Episode, number: int) -> Record:
    """Return the test record of an episode at even samples; `number` names it where it has no name."""
    record = episode.record(number)
    known = record.known
    if known.sum() < 2:
        raise InputError(f"{record.name}: the angle is known at {known.sum()} samples, at least 2 are needed")
    first = int(known.argmax())
    part = record.part(first)
    if "stroke_mm" in episode.metadata or not first:
        return part
    low, high = np.round([part.pull_mm.min(), part.pull_mm.max()], 1) + 0.0
    return dataclasses.replace(part, stroke_mm=(float(low), float(high)))


def complete_pieces(episode: Episode) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, measured_deg)` of the pieces of an episode; see `complete_ranges`."""
    pull, bend = episode.pull_mm, episode.measured_deg
    return [(pull[begin:end], bend[begin:end]) for begin, end in complete_ranges(episode)]


def complete_ranges(episode: Episode, samples: int | None = None) -> list[tuple[int, int]]:
    """Return the pieces of an episode without a missing measurement: first sample, and one after the last.

    An episode without missing samples is one piece. In others, a piece of one sample, or with the command at
    rest, is left out: nothing can be identified from it. Raises `ValueError` where no piece is left.
    """
    pull, known = episode.pull_mm[:samples], ~np.isnan(episode.measured_bend[:samples])
    if known.all():
        return [(0, len(known))]
    moving = [
        (begin, end)
        for begin, end in runs_of_true(known)
        if (np.abs(np.diff(pull[begin:end])) > STILL_MM).any()
    ]
    if not moving:
        raise InputError(
            f"{episode.record().name}: too much of the measured angle is missing at this sample time"
        )
    return moving


def recorded_variance(episode: Episode) -> float | None:
    """Return the variance of the noise in the measurements of a simulated episode [deg^2].

    It is that of the sensor's own noise, of its rounding (a step^2 / 12), and of what the recipe adds; of a
    stereo sensor, the measured variance of the usual rig. None, where it is unknown: the episode was
    measured, or its measurements have no noise.
    """
    preset = episode.metadata.get("preset")
    if episode.is_measured or not isinstance(preset, dict):
        return None
    try:
        sensor = parse_yaml(episode.attachments.get("recipe.yaml", b""))["sensor"]
    except (KeyError, TypeError, ValueError):
        sensor = None
    sensor = sensor if isinstance(sensor, dict) else {}
    if isinstance(sensor.get("stereo"), dict):  # two cameras measured it
        return noise_variance(STEREO, 0.0)
    noise, step = (float(preset.get(name, 0.0)) for name in ("sensor_noise", "sensor_resolution"))
    variance = np.degrees(noise) ** 2 + np.degrees(step) ** 2 / 12 + _added(sensor)
    return float(variance) if variance > 0 else None


def _added(sensor: Mapping[str, Any]) -> float:
    """Variance that a recipe adds to the measurements [deg^2]."""
    try:
        added = float(sensor["variance_deg2"])
    except (KeyError, TypeError, ValueError):
        return 0.0
    return added if 0 <= added < np.inf else 0.0


def common_variance(paths: Sequence[Path]) -> tuple[float, bool]:
    """Return R of the measurements of all records together [deg^2], and whether every record states it."""
    found = [recorded_variance(read_episode(file)) for path in paths for file in episode_files(path)]
    known = [variance for variance in found if variance is not None]
    return (float(np.mean(known)) if known else DEFAULT_VARIANCE), len(known) == len(found)


def chosen_measurements(asked: str, paths: Sequence[Path]) -> tuple[str, str]:
    """Return the measurements that estimators get, `drawn` or `recorded`, and a line about measured logs.

    `auto` is recorded where every record is a measured log, else drawn. The line is empty without such a log.
    """
    if asked not in MEASUREMENTS:
        raise InputError(
            f"measurements = {asked!r}: must be {', '.join(MEASUREMENTS[:-1])} or {MEASUREMENTS[-1]}"
        )
    files = [file for path in paths for file in episode_files(path)]
    measured = sum(read_metadata(file).get("source") == "measured" for file in files)
    chosen = asked
    if asked == "auto":
        chosen = "recorded" if files and measured == len(files) else "drawn"
    if not measured:
        return chosen, ""
    logs = f"{measured} of {len(files)} records are measured logs"
    if chosen == "recorded":
        return chosen, f"{logs}: estimators get their recorded measurements, and are scored against the same"
    return chosen, f"{logs}: their angles are taken for true, and noise is drawn on top of them"
