"""Recorded measurements: their noise as the file tells it, and estimates written beside them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.episode import Episode
from twin.errors import InputError
from twin.evaluation.case import make_case
from twin.evaluation.method import Method
from twin.evaluation.protocol import Protocol
from twin.evaluation.reading import at_sample_time, evaluation_record
from twin.files.yaml_text import parse_yaml
from twin.recording import EpisodeWriter, episode_files, read_episode, read_metadata
from twin.recording.estimate import estimate_message, estimate_topic
from twin.recording.messages import to_nanoseconds
from twin.signals.noise import noise_variance
from twin.signals.stereo_noise import STEREO

MEASUREMENTS = ("auto", "drawn", "recorded")
"""Choices of what estimators get."""
DEFAULT_VARIANCE = 0.1
"""R of a sensor that nothing is known of: that of the paper's training [deg^2]."""


def recorded_variance(episode: Episode) -> float | None:
    """Return the variance of the noise in the measurements of a simulated episode [deg^2].

    It is that of the sensor's own noise, of its rounding (a step^2 / 12), and of what the recipe adds; of a
    stereo sensor, that which was measured of the usual rig.
    None, where the episode does not tell: it was measured, or its measurements have no noise.
    """
    preset = episode.metadata.get("preset")
    if episode.is_measured or not isinstance(preset, dict):
        return None
    sensor = _sensor(episode)
    if isinstance(sensor.get("stereo"), dict):  # two cameras measured it
        return noise_variance(STEREO, 0.0)
    noise, step = (float(preset.get(name, 0.0)) for name in ("sensor_noise", "sensor_resolution"))
    variance = np.degrees(noise) ** 2 + np.degrees(step) ** 2 / 12 + _added(sensor)
    return float(variance) if variance > 0 else None


def _sensor(episode: Episode) -> dict[str, Any]:
    """Return what the recipe of an episode says of its sensor; nothing where there is none."""
    try:
        sensor = parse_yaml(episode.attachments.get("recipe.yaml", b""))["sensor"]
    except (KeyError, TypeError, ValueError):
        return {}
    return sensor if isinstance(sensor, dict) else {}


def _added(sensor: Mapping[str, Any]) -> float:
    """Variance that a recipe adds to the measurements, by what it says of the sensor [deg^2]."""
    try:
        added = float(sensor["variance_deg2"])
    except (KeyError, TypeError, ValueError):
        return 0.0
    return added if 0 <= added < np.inf else 0.0


def common_variance(paths: Sequence[Path]) -> tuple[float, bool]:
    """Return R of the measurements of all records together, and whether every record tells it [deg^2].

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: a file is damaged.
    """
    found = [recorded_variance(read_episode(file)) for path in paths for file in episode_files(path)]
    known = [variance for variance in found if variance is not None]
    return (float(np.mean(known)) if known else DEFAULT_VARIANCE), len(known) == len(found)


def chosen_measurements(asked: str, paths: Sequence[Path]) -> tuple[str, str]:
    """Return the measurements that estimators get, and a line that says so of measured logs.

    Args:
        asked: `drawn` or `recorded`, or `auto`: recorded where every record is a measured log, which holds
            what its sensor saw, else drawn.
        paths: folders of records, or files.

    Returns:
        `drawn` or `recorded`; and the line, empty where no record is a measured log.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: a file is damaged, or there is no such choice.
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


def write_estimates(
    files: Mapping[str, Path],
    methods: Sequence[Method],
    sample_time: float,
    variance: float,
    folder: Path,
    initial_error_deg: float = 20.0,
) -> list[Path]:
    """Write each record anew with what methods make of its recorded measurements, as `/estimate/METHOD`.

    Args:
        files: MCAP files of records, by the names of the new ones without their ending.
        methods: oracles among them are left out.
        sample_time: T of the estimates [s]; the record keeps its own samples.
        variance: R that the methods are told [deg^2].
        folder: where the new files go; it exists.
        initial_error_deg: how far the initial estimate is off [deg].

    Returns:
        The files.

    Raises:
        ValueError: a file is damaged, or the sample time does not fit.
    """
    protocol = Protocol("paper", 1, sample_time, initial_error_deg, recorded_variance=variance)
    written: list[Path] = []
    for name, file in files.items():
        episode = read_episode(file)
        record = evaluation_record(at_sample_time(episode, sample_time), 0)
        case = make_case([(0, record)], protocol)
        begin = len(at_sample_time(episode, sample_time).time) - len(record.pull_mm)
        time = episode.time[0] + sample_time * (begin + np.arange(len(record.pull_mm)))
        target = folder / f"{name}.mcap"
        with EpisodeWriter(target) as writer:
            writer.write(episode)
            for method in methods:
                if method.oracle:
                    continue
                topic, estimate = estimate_topic(method.name), method.estimate(case)[0]
                for nanoseconds, bend_deg in zip(to_nanoseconds(time), estimate.tolist(), strict=True):
                    writer.add_message(topic, estimate_message(bend_deg), nanoseconds)
        written.append(target)
    return written
