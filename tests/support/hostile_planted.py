"""Foreign links, folders and files under the names that a command writes to."""

import itertools
import os
from collections.abc import Callable
from pathlib import Path, PurePosixPath

from hostile_files import a_folder, away
from hostile_runs import Place
from pickles import PICKLES

NAMES: dict[str, Callable[[PurePosixPath], str]] = {
    "output": lambda path: path.name,
    "partial": lambda path: f".{path.name}.partial",
    "token partial": lambda path: f".{path.name}.deadbeef.partial",
    "part": lambda path: f".{path.stem}.part{path.suffix}",
    "tmp": lambda path: f"{path.name}.tmp",
    "hidden tmp": lambda path: f".{path.name}.tmp",
    "lock": lambda path: f".{path.name}.lock",
    "state": lambda path: f".{path.stem}.calibration",
    "state npz": lambda path: f".{path.stem}.calibration.npz",
    "state json": lambda path: f".{path.stem}.calibration.json",
    "backup": lambda path: f"{path.name}~",
    "checkpoints": lambda path: "checkpoints",
    "lock of folder": lambda path: ".lock",
}
"""Names beside an output, or its own, under which something may stand."""


def make_canary(path: Path, place: Place) -> None:
    path.write_bytes(PICKLES["pickle"](b"", place.canary))


THINGS: dict[str, Callable[[Path, Place], None]] = {
    "link to a file": lambda path, place: path.symlink_to(place.precious),
    "link to a folder": lambda path, place: path.symlink_to(place.around / "outside" / "folder"),
    "link to nothing": lambda path, place: path.symlink_to(place.around / "outside" / "new"),
    "link to itself": lambda path, place: path.symlink_to(path.name),
    "a folder": a_folder,
    "a file": lambda path, place: path.write_text("my own\n"),
    "a pickle": make_canary,
    "a pipe": lambda path, place: os.mkfifo(path),
}
"""Kind of the planted thing."""
PLANTS = [f"{thing} as {name}" for thing, name in itertools.product(THINGS, NAMES)]


def plant(output: str, plant: str, place: Place) -> str:
    """Put a thing beside an output of a command, or in its place; its name in the working folder."""
    thing, name = plant.split(" as ")
    path = place.work / PurePosixPath(output).with_name(NAMES[name](PurePosixPath(output)))
    path.parent.mkdir(parents=True, exist_ok=True)
    away(path)
    THINGS[thing](path, place)
    return path.relative_to(place.work).as_posix()


def is_of_the_command(plant: str) -> bool:
    """Whether a command may replace it: its own output, or a file that a killed run of it would have left."""
    thing, name = plant.split(" as ")
    files = (
        "a file",
        "a pickle",
        "link to a file",
        "link to a folder",
        "link to nothing",
        "link to itself",
        "a pipe",
    )
    if name == "output":
        return thing in files
    return name not in ("backup",) and thing in ("a file", "a pickle")
