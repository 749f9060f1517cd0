"""Simulate the frozen test set of the benchmark, and write what its records are told by.

`python -m scripts.freeze_test_set NAME`, with a name that no set had: figures that were published on the
former set do not compare with those on this. The recipe stays as the file has it.
"""

import json
import sys
from pathlib import Path

import numpy as np

from scripts.progress import Progress
from twin.errors import DivergedError
from twin.files.assets import assets_folder
from twin.files.atomic import write_whole
from twin.suite.frozen import FILE, drives_sha256, frozen_drives, frozen_file
from twin.suite.scenarios import SAMPLE_TIME, simulate_drives


def freeze(name: str, path: Path) -> None:
    """Write the file.

    Raises:
        FloatingPointError: a simulation diverged.
    """
    told, drives = frozen_file().model_dump(), frozen_drives()
    places = np.rint(np.array(told["times_s"]) / SAMPLE_TIME).astype(int)
    rows = []
    for drive, episode in zip(drives, simulate_drives(drives, Progress("records", "sample")), strict=True):
        if episode is None:
            raise DivergedError(f"the simulation of a twin ({drive.twin}) diverged")
        rows.append(json.dumps(np.round(np.degrees(episode.bend[places]), 3).tolist()))
    told |= {"name": name, "drives_sha256": drives_sha256(drives)}
    del told["bends_deg"]
    lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in told.items()]
    bends = ' "bends_deg": [\n  ' + ",\n  ".join(rows) + "\n ]"
    write_whole(path, "{\n" + ",\n".join([*lines, bends]) + "\n}\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m scripts.freeze_test_set NAME")
    freeze(sys.argv[1], assets_folder() / FILE)
