"""Errors of every single run of a comparison: what others need to compare theirs in pairs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from twin.errors import InputError
from twin.evaluation.score import LONGEST_TEXT, Score
from twin.files.arrays import MOST_ARRAYS
from twin.files.bounded import MEBIBYTE
from twin.files.headed_arrays import read_headed, write_headed

Array = NDArray[np.float64]
Name = Annotated[str, Field(max_length=LONGEST_TEXT)]
MOST_BYTES = 512 * MEBIBYTE
"""Size of a file of runs, packed and unpacked [bytes]."""


class RunsHead(BaseModel):
    """Whose runs follow: one line of `evaluation.json`.

    Attributes:
        method: name in the tables.
        noise: kind of the noise.
        level: its level [deg^2 or deg].
        sample_time_s: T [s].
        stroke_mm: lowest and highest pulling distance [mm].
        twin: kind of twin, `measured`, or the name of a preset.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    method: Name
    noise: Name
    level: float
    sample_time_s: float
    stroke_mm: Annotated[list[float], Field(max_length=2)]
    twin: Name


_PREFIX = "square_deg2"
_HEADS = TypeAdapter(Annotated[list[RunsHead], Field(max_length=MOST_ARRAYS - 1)])


def save_runs(path: Path, scores: Sequence[Score], squares: Sequence[Array]) -> None:
    """Write the mean square errors (K, R, S) [deg^2] behind each score into one `.npz`, whole or not at all.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    heads = [
        RunsHead(
            method=score.method,
            noise=score.noise,
            level=score.level,
            sample_time_s=score.sample_time_s,
            stroke_mm=list(score.stroke_mm),
            twin=score.twin,
        )
        for score in scores
    ]
    write_headed(path, _PREFIX, heads, [of.astype(np.float32) for of in squares])


def load_runs(path: Path) -> list[tuple[RunsHead, Array]]:
    """Read what `save_runs` wrote: heads, each with its (K, R, S) mean square errors [deg^2].

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no runs.
    """
    return read_headed(path, _PREFIX, _HEADS, lambda head, of: (head, _errors(of)), "runs", MOST_BYTES)


def _errors(squares: Array) -> Array:
    if squares.dtype.kind != "f" or squares.ndim != 3 or not squares.size:
        raise InputError(f"runs of shape {squares.shape}: must be numbers by training, record and draw")
    if not np.isfinite(squares).all() or (squares < 0).any():
        raise InputError("a mean square error is no positive number")
    return squares.astype(float)
