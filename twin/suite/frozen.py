"""The frozen test set: records that stay, so that figures of others compare.

`endotwin evaluate --suite full --seed 1` makes it from its recipe. Whatever it is made or read from, records
are known by what they hold: their angles at some times are in `assets/frozen_test_set.json`. Where physics or
ranges change on purpose, `python -m scripts.freeze_test_set NAME` writes the file anew, under another name.
"""

import functools
import hashlib
import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from twin.evaluation.record import EvaluationRecord
from twin.files.assets import assets_folder
from twin.preset import load_preset, load_ranges
from twin.suite.scenarios import Scenario, scenarios

FILE = "frozen_test_set.json"
TOLERANCE_DEG = 0.05
"""Largest difference of an angle to the frozen one: another processor rounds otherwise."""
_DIGITS = 9
"""Digits of what is hashed: another processor's last ones differ."""


class FrozenFile(BaseModel):
    """Contents of `frozen_test_set.json`.

    Attributes:
        name: of the test set; another one has another name.
        preset: packaged preset that is randomised.
        seconds: length of each record [s].
        seed: of commands and twins.
        drives_sha256: of all that is simulated; see `drives_sha256`.
        times_s: times of the angles that are kept [s].
        bends_deg: angle of each record at these times [deg].
    """

    name: str
    preset: str
    seconds: float
    seed: int
    drives_sha256: str
    times_s: list[float]
    bends_deg: list[list[float]]


def frozen_name(records: Sequence[EvaluationRecord], sample_time: float) -> str | None:
    """Return the name of the frozen test set, if these records, at T [s], are all of it; else None."""
    frozen = frozen_file()
    if len(records) != len(frozen.bends_deg):
        return None
    for record, wanted in zip(records, frozen.bends_deg, strict=True):
        time = np.arange(len(record.bend_deg)) * sample_time
        if time[-1] < frozen.times_s[-1] - sample_time:
            return None
        found = np.interp(frozen.times_s, time, record.bend_deg)
        if np.abs(found - wanted).max() > TOLERANCE_DEG:
            return None
    return frozen.name


@functools.cache
def frozen_file() -> FrozenFile:
    """Return what the frozen test set is told by."""
    return FrozenFile.model_validate_json((assets_folder() / FILE).read_bytes())


def drives_sha256(drives: Sequence[Scenario]) -> str:
    """Return the SHA-256 of all that is simulated: endoscopes, commands and bends of the sheath."""
    total = hashlib.sha256()
    for drive in drives:
        parameters = {name: _rounded(value) for name, value in sorted(drive.preset.to_dict().items())}
        told = [drive.twin, drive.signal, *drive.stroke_mm, parameters]
        total.update(json.dumps(told).encode())
        total.update(_bytes(drive.pull * 1e3))
        total.update(b"" if drive.sheath_bend is None else _bytes(drive.sheath_bend))
    return total.hexdigest()


def _rounded(value: object) -> object:
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _bytes(values: NDArray[np.float64]) -> bytes:
    """Return values to six decimals, in an order of bytes that is everywhere the same."""
    return np.rint(values * 1e6).astype("<i8").tobytes()


def frozen_drives() -> list[Scenario]:
    """Return the drives of the frozen test set, by the recipe in its file."""
    frozen = frozen_file()
    return scenarios(load_preset(frozen.preset), load_ranges(frozen.preset), frozen.seconds, frozen.seed)
