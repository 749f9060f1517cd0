"""Simulate the frozen test set of the benchmark, and write what its records are told by.

`python -m scripts.freeze_test_set`. Give the set another name (`twin/suite/frozen.py`) before: figures that
were published on the former one do not compare with those on this.
"""

import json
import sys
from pathlib import Path

import numpy as np

from scripts.progress import Progress
from twin.errors import DivergedError
from twin.files.assets import assets_folder
from twin.files.atomic import write_whole
from twin.suite.frozen import FILE, NAME, PRESET, SECONDS, SEED, drives_sha256, frozen_drives
from twin.suite.scenarios import SAMPLE_TIME, simulate_drives

EVERY_S = 5.0


def freeze(path: Path) -> None:
    """Write the file.

    Raises:
        FloatingPointError: a simulation diverged.
    """
    drives = frozen_drives()
    times = np.arange(0.0, SECONDS, EVERY_S)
    places = np.rint(times / SAMPLE_TIME).astype(int)
    rows = []
    for drive, episode in zip(drives, simulate_drives(drives, Progress("records", "sample")), strict=True):
        if episode is None:
            raise DivergedError(f"the simulation of a twin ({drive.twin}) diverged")
        rows.append(json.dumps(np.round(np.degrees(episode.bend[places]), 3).tolist()))
    told = {
        "name": NAME,
        "preset": PRESET,
        "seconds": SECONDS,
        "seed": SEED,
        "drives_sha256": drives_sha256(drives),
        "times_s": times.tolist(),
    }
    lines = [f" {json.dumps(name)}: {json.dumps(value)}" for name, value in told.items()]
    bends = ' "bends_deg": [\n  ' + ",\n  ".join(rows) + "\n ]"
    write_whole(path, "{\n" + ",\n".join([*lines, bends]) + "\n}\n")


if __name__ == "__main__":
    freeze(assets_folder() / FILE)
    sys.exit(0)
