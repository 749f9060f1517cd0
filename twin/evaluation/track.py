"""Track: the estimates of every method along one record under one noise, behind a tracking figure."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.headed_arrays import read_headed, write_headed

Array = NDArray[np.float64]
Name = Annotated[str, Field(max_length=100)]


MOST_BYTES = 128 * MEBIBYTE
"""Size of a file of tracks, packed and unpacked [bytes]."""


class TrackHead(BaseModel):
    """Head of one track in its file.

    Attributes:
        noise: kind of the noise.
        level: its level [deg^2 or deg].
        methods: names of the methods whose estimates follow.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    noise: Name
    level: float
    methods: Annotated[list[Name], Field(max_length=200)]


_PREFIX = "track"
_HEADS = TypeAdapter(Annotated[list[TrackHead], Field(max_length=1000)])


@dataclasses.dataclass(frozen=True)
class Track:
    """N samples of one test episode: truth, measurement and the estimate of each method.

    Attributes:
        noise: kind of the measurement noise, as in `evaluation.json`.
        level: its covariance [deg^2] or its expectation [deg].
        time: (N,) time since the start of the record [s].
        truth_deg: (N,) true bending angle [deg].
        measurement_deg: (N,) bending angle as the noisy sensor saw it [deg].
        estimates: (N,) estimated bending angle [deg] by method; sample 0 is the wrong initial estimate.
    """

    noise: str
    level: float
    time: Array
    truth_deg: Array
    measurement_deg: Array
    estimates: dict[str, Array]

    def error_deg(self, method: str) -> Array:
        """Return estimate minus truth (N,) of a method [deg].

        Raises:
            ValueError: the track has no such method.
        """
        if method not in self.estimates:
            raise InputError(f"no estimates of {method!r}; there are: {', '.join(self.estimates)}")
        return self.estimates[method] - self.truth_deg


def save_tracks(path: Path, tracks: Sequence[Track]) -> None:
    """Write tracks into one `.npz`, whole or not at all.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    heads = [TrackHead(noise=of.noise, level=of.level, methods=list(of.estimates)) for of in tracks]
    rows = [np.stack([of.time, of.truth_deg, of.measurement_deg, *of.estimates.values()]) for of in tracks]
    write_headed(path, _PREFIX, heads, rows)


def load_tracks(path: Path) -> list[Track]:
    """Read what `save_tracks` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no tracks.
    """
    return read_headed(path, _PREFIX, _HEADS, _track, "tracks", MOST_BYTES)


def _track(head: TrackHead, rows: NDArray[Any]) -> Track:
    lines = 3 + len(head.methods)
    if rows.dtype.kind != "f" or rows.ndim != 2 or len(rows) != lines or rows.shape[1] < 2:
        raise InputError(f"a track of shape {rows.shape}: must be numbers in {lines} lines")
    if len(set(head.methods)) < len(head.methods):
        raise InputError("a method is there twice")
    time, truth, measurement, *estimates = rows
    if not np.isfinite(time).all() or not np.isfinite(truth).all():
        raise InputError("a time or a true angle is not finite")
    return Track(
        noise=head.noise,
        level=head.level,
        time=time,
        truth_deg=truth,
        measurement_deg=measurement,
        estimates=dict(zip(head.methods, estimates, strict=True)),
    )
