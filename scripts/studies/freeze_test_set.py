"""`python -m scripts.studies.freeze_test_set NAME`: simulate the test set again, and write its fingerprint.

Give a name that no test set had: figures that were published on the former set do not compare with those on
the new one. The recipe is that of the existing file; it is for changes of physics or ranges on purpose.
"""

import hashlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scripts.progress import Progress
from twin.errors import DivergedError
from twin.evaluation.scenarios import (
    FINGERPRINT_FILE,
    SAMPLE_TIME,
    Scenario,
    scenarios,
    simulate_drives,
    test_set_fingerprint,
)
from twin.files.assets import assets_folder
from twin.files.atomic import write_whole
from twin.preset import load_preset, load_ranges

_DIGITS = 9  # that are hashed: another processor's last ones differ
_LATER = ("sensor_zero", "sensor_zero_deviation", "sensor_scale")
"""Parameters that presets did not have when the set was frozen; no angle of the tip depends on them."""


def frozen_drives() -> list[Scenario]:
    """Return the drives of the published test set, by its recipe."""
    recipe = test_set_fingerprint()
    return scenarios(load_preset(recipe.preset), load_ranges(recipe.preset), recipe.seconds, recipe.seed)


def drives_sha256(drives: Sequence[Scenario]) -> str:
    """Return the SHA-256 of all that is simulated: endoscopes, commands and bends of the sheath."""
    total = hashlib.sha256()
    for drive in drives:
        stated = sorted(drive.preset.to_dict().items())
        parameters = {name: _rounded(value) for name, value in stated if name not in _LATER}
        total.update(json.dumps([drive.twin, drive.signal, *drive.stroke_mm, parameters]).encode())
        total.update(_bytes(drive.pull * 1e3))
        total.update(b"" if drive.sheath_bend is None else _bytes(drive.sheath_bend))
    return total.hexdigest()


def _rounded(value: object) -> object:
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _bytes(values: NDArray[np.float64]) -> bytes:
    """Return values to six decimals, in the same byte order everywhere."""
    return np.rint(values * 1e6).astype("<i8").tobytes()


def freeze(name: str, path: Path) -> None:
    """Write the fingerprint; raises `FloatingPointError` where a simulation diverged."""
    contents, drives = test_set_fingerprint().model_dump(), frozen_drives()
    places = np.rint(np.array(contents["times_s"]) / SAMPLE_TIME).astype(int)
    rows = []
    for drive, episode in zip(drives, simulate_drives(drives, Progress("records", "sample")), strict=True):
        if episode is None:
            raise DivergedError(f"the simulation of a twin ({drive.twin}) diverged")
        rows.append(json.dumps(np.round(np.degrees(episode.bend[places]), 3).tolist()))
    contents |= {"name": name, "drives_sha256": drives_sha256(drives)}
    del contents["bends_deg"]
    lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in contents.items()]
    bends = ' "bends_deg": [\n  ' + ",\n  ".join(rows) + "\n ]"
    write_whole(path, "{\n" + ",\n".join([*lines, bends]) + "\n}\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m scripts.studies.freeze_test_set NAME")
    freeze(sys.argv[1], assets_folder() / FINGERPRINT_FILE)
