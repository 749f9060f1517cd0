"""Arrays of a comparison: errors of every run (`runs.npz`), and estimates along a record (`tracks.npz`)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from twin.episode import Record
from twin.errors import InputError
from twin.evaluation.protocol import Condition
from twin.evaluation.score import LONGEST_TEXT, Score
from twin.files.arrays import MOST_ARRAYS, read_headed, write_headed
from twin.files.bounded import MEBIBYTE

Array = NDArray[np.float64]
Name = Annotated[str, Field(max_length=LONGEST_TEXT)]
MOST_RUNS_BYTES, MOST_TRACKS_BYTES = 512 * MEBIBYTE, 128 * MEBIBYTE
"""Size of each file, packed and unpacked [bytes]."""
_RUNS, _TRACKS = "square_deg2", "track"


class TrackHead(BaseModel):
    """Noise of a track, and the methods whose estimates follow."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    noise: Name
    level: float
    methods: Annotated[list[Name], Field(max_length=200)]


class RunsHead(BaseModel):
    """Line of `evaluation.json` whose runs follow; fields as in `Score`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    method: Name
    noise: Name
    level: float
    sample_time_s: float
    stroke_mm: Annotated[list[float], Field(max_length=2)]
    twin: Name


_RUNS_HEADS = TypeAdapter(Annotated[list[RunsHead], Field(max_length=MOST_ARRAYS - 1)])
_TRACK_HEADS = TypeAdapter(Annotated[list[TrackHead], Field(max_length=1000)])


def save_runs(path: Path, scores: Sequence[Score], squares: Sequence[Array]) -> None:
    """Write the mean square errors (K, R, S) [deg^2] of each score into one `.npz`, atomically."""
    rows = (score.to_dict() for score in scores)
    heads = [RunsHead(**{name: row[name] for name in RunsHead.model_fields}) for row in rows]
    write_headed(path, _RUNS, heads, [of.astype(np.float32) for of in squares])


def load_runs(path: Path) -> list[tuple[RunsHead, Array]]:
    """Read a file of `save_runs`: heads, each with its (K, R, S) mean square errors [deg^2]."""
    return read_headed(
        path, _RUNS, _RUNS_HEADS, lambda head, of: (head, _errors(of)), "runs", MOST_RUNS_BYTES
    )


def _errors(squares: Array) -> Array:
    if squares.dtype.kind != "f" or squares.ndim != 3 or not squares.size:
        raise InputError(f"runs of shape {squares.shape}: must be numbers by training, record and draw")
    if not np.isfinite(squares).all() or (squares < 0).any():
        raise InputError("a mean square error is no positive number")
    return squares.astype(float)


def save_tracks(path: Path, tracks: Mapping[Condition, Record]) -> None:
    """Write estimates along records, by noise, into one `.npz`, atomically."""
    heads = [
        TrackHead(noise=noise, level=level, methods=list(record.estimates))
        for (noise, level), record in tracks.items()
    ]
    rows = [
        np.stack([of.time, of.truth_deg, of.measured_deg, *of.estimates.values()]) for of in tracks.values()
    ]
    write_headed(path, _TRACKS, heads, rows)


def load_tracks(path: Path) -> dict[Condition, Record]:
    """Read a file of `save_tracks`: records with their estimates, by noise; their command is not in it."""
    return dict(read_headed(path, _TRACKS, _TRACK_HEADS, _track, "tracks", MOST_TRACKS_BYTES))


def _track(head: TrackHead, rows: NDArray[Any]) -> tuple[Condition, Record]:
    lines = 3 + len(head.methods)
    if rows.dtype.kind != "f" or rows.ndim != 2 or len(rows) != lines or rows.shape[1] < 2:
        raise InputError(f"a track of shape {rows.shape}: must be numbers in {lines} lines")
    if len(set(head.methods)) < len(head.methods):
        raise InputError("a method is there twice")
    time, truth, measured, *estimates = rows
    if not np.isfinite(time).all() or not np.isfinite(truth).all():
        raise InputError("a time or a true angle is not finite")
    record = Record(
        time=time,
        pull_mm=np.full(len(time), np.nan),
        truth_deg=truth,
        measured_deg=measured,
        estimates=dict(zip(head.methods, estimates, strict=True)),
    )
    return (head.noise, head.level), record
