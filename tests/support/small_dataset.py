"""A dataset that is made in half a second, a measured log, and what tests do with their files."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from twin.dataset.recipe import Recipe
from twin.dataset.write import Written, write_dataset
from twin.episode import Episode
from twin.measured.log import read_measured_log
from twin.preset.preset import Preset

SMALL = Preset(
    "small",
    vertebrae=6,
    section_stiffness=0.05,
    joint_friction=1e-3,
    wire_offset=1.3e-3,
    wire_stiffness=8e3,
    pretension=3.0,
    sheath_elements=2,
    time_step=2.5e-3,
    control_period=1e-2,
)
TWO_PLANES = SMALL.replace(bending_planes=2)
RECIPE = Recipe(SMALL, ((-1.0, 1.0),), seconds=1.0, episodes=3, seeds=(11,))
NAMES = [f"episode_000{number}.mcap" for number in range(3)]
"""The recordings of its episodes."""
SECOND = NAMES[1]
FALLING = SMALL.replace(section_mass=10.0, gravity_z=100.0, section_stiffness=1e-6, wire_stiffness=10.0)
"""Its simulation diverges."""


def changed(recipe: Recipe = RECIPE, **changes: Any) -> Recipe:
    return dataclasses.replace(recipe, **changes)


def make(folder: Path, recipe: Recipe = RECIPE, *, csv: bool = False) -> Written:
    """Write a dataset without starting a process."""
    with ThreadPoolExecutor(1) as executor:
        return write_dataset(recipe, folder, executor, csv=csv)


def contents(folder: Path) -> dict[str, bytes]:
    """The bytes of every file, hidden ones too."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def identities(folder: Path) -> dict[str, tuple[int, int]]:
    """What changes when an MCAP file is written again, even with the same bytes."""
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.glob("*.mcap")}


def flip(path: Path, place: float) -> None:
    """Invert one bit, so far into the file."""
    data = bytearray(path.read_bytes())
    data[int(place * len(data))] ^= 1
    path.write_bytes(bytes(data))


def measured_log(folder: Path) -> Episode:
    """A log of a loop, by way of a CSV file in a folder."""
    (folder / "log.csv").write_text(
        "time_s,command_deg,angle_deg\n"
        + "".join(f"{k / 10},{9 * np.sin(k / 9)},{40 * np.sin(k / 9 - 0.3)}\n" for k in range(120))
    )
    return read_measured_log(folder / "log.csv")
