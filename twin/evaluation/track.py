"""Track: the estimates of every method along one record under one noise, behind a tracking figure."""

import dataclasses
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError
from twin.files.atomic import write_whole

Array = NDArray[np.float64]


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
    heads = [{"noise": t.noise, "level": t.level, "methods": list(t.estimates)} for t in tracks]
    arrays = {"heads": np.array(json.dumps(heads))}
    for number, track in enumerate(tracks):
        rows = [track.time, track.truth_deg, track.measurement_deg, *track.estimates.values()]
        arrays[f"track_{number}"] = np.stack(rows)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_whole(path, buffer.getvalue())


def load_tracks(path: Path) -> list[Track]:
    """Read what `save_tracks` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no tracks.
    """
    if not path.is_file():
        raise MissingFileError(f"no file {path}")
    try:
        with np.load(path, allow_pickle=False) as arrays:
            heads = json.loads(str(arrays["heads"]))
            return [_track(head, arrays[f"track_{number}"]) for number, head in enumerate(heads)]
    except Exception as error:
        # Damage shows as any of the exceptions of zipfile, zlib, numpy and json.
        raise InputError(f"{path} holds no tracks: {' '.join(str(error).split())}") from error


def _track(head: dict[str, Any], rows: Array) -> Track:
    time, truth, measurement, *estimates = rows
    return Track(
        noise=head["noise"],
        level=head["level"],
        time=time,
        truth_deg=truth,
        measurement_deg=measurement,
        estimates=dict(zip(head["methods"], estimates, strict=True)),
    )
