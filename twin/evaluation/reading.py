"""Reading the folders that a verb is given into records at one sample time.

A measured log may have missing samples and gaps; each function says what it makes of them.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.evaluation.record import EvaluationRecord
from twin.recording import read_dataset

Array = NDArray[np.float64]

STILL_MM = 1e-9
"""A command that moves by no more than this in a piece of a record tells nothing of hysteresis."""


def read_episodes(paths: Sequence[Path], sample_time: float) -> list[Episode]:
    """Read all episodes of folders and files: simulated ones thinned, measured ones interpolated.

    `measured_bend` is NaN where a measurement is missing, or a measured log has a gap.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: a file is damaged, or the sample time does not fit it.
    """
    episodes = [episode for path in paths for episode in read_dataset(path, hidden=False)]
    return [at_sample_time(episode, sample_time) for episode in episodes]


def at_sample_time(episode: Episode, sample_time: float) -> Episode:
    """Return an episode at even samples: a simulated one thinned, a measured one interpolated.

    Raises:
        ValueError: the sample time does not fit it.
    """
    return episode.resampled(sample_time)


def true_records(paths: Sequence[Path], sample_time: float) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, true bend_deg)` of each episode, to train on.

    Where the angle of a measured log is not known, it is linear between its neighbours.
    """
    return [(episode.pull_mm, episode.truth_deg) for episode in read_episodes(paths, sample_time)]


def evaluation_records(paths: Sequence[Path], sample_time: float) -> list[EvaluationRecord]:
    """Return what noise is added to and scored against: each episode from its first known angle on.

    The truth of a simulated episode is known throughout; that of a measured log, where it was measured.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: a file is damaged, the sample time does not fit it, or fewer than two angles are known.
    """
    episodes = read_episodes(paths, sample_time)
    return [evaluation_record(episode, number) for number, episode in enumerate(episodes)]


def whole_pieces(episode: Episode) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, measured bend_deg)` of the pieces of an episode in which no measurement is missing.

    A record without missing samples is one piece, as it is. Of another, a piece of one sample, or in which
    the command stands still, is left out: nothing is identified from it.

    Raises:
        ValueError: no piece is left.
    """
    pull, bend = episode.pull_mm, episode.measured_deg
    return [(pull[begin:end], bend[begin:end]) for begin, end in whole_ranges(episode)]


def whole_ranges(episode: Episode, samples: int | None = None) -> list[tuple[int, int]]:
    """Return the first sample of each piece of `whole_pieces`, and the one after its last.

    Args:
        episode: at even samples.
        samples: look at so many from the start on; all, if not given.

    Raises:
        ValueError: no piece is left.
    """
    pull, known = episode.pull_mm[:samples], ~np.isnan(episode.measured_bend[:samples])
    if known.all():
        return [(0, len(known))]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]])))
    pieces = [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]
    moving = [(begin, end) for begin, end in pieces if (np.abs(np.diff(pull[begin:end])) > STILL_MM).any()]
    if not moving:
        raise InputError(
            f"{record_name(episode, 0)}: too much of the measured angle is missing at this sample time"
        )
    return moving


def evaluation_record(episode: Episode, number: int) -> EvaluationRecord:
    """Return the test record of an episode at even samples; `number` names it where it has no name.

    Raises:
        ValueError: fewer than two angles are known.
    """
    seen = np.isfinite(episode.measured_bend) if episode.is_measured else np.ones(len(episode.time), bool)
    if seen.sum() < 2:
        name = record_name(episode, number)
        raise InputError(f"{name}: the angle is known at {seen.sum()} samples, at least 2 are needed")
    first = int(seen.argmax())
    pull = episode.pull_mm[first:]
    low, high = episode.metadata.get("stroke_mm") or np.round([pull.min(), pull.max()], 1) + 0.0
    return EvaluationRecord(
        pull_mm=pull,
        bend_deg=episode.truth_deg[first:],
        seen=seen[first:],
        stroke_mm=(float(low), float(high)),
        twin=_twin(episode),
        name=record_name(episode, number),
        measured_deg=episode.measured_deg[first:],
        preset="" if episode.is_measured else _preset(episode),
    )


def _twin(episode: Episode) -> str:
    facts = episode.metadata
    if "twin" in facts:
        return str(facts["twin"])
    if episode.is_measured:
        return "measured"
    return _preset(episode) or "simulated"


def _preset(episode: Episode) -> str:
    preset = episode.metadata.get("preset")
    return str((preset.get("name") if isinstance(preset, Mapping) else preset) or "")


def record_name(episode: Episode, number: int) -> str:
    """Return the name of a record; `number` names it where it has none."""
    return str(episode.metadata.get("name") or f"episode_{episode.metadata.get('episode', number):04}")
