"""Damage to a file that a verb reads: its bytes, its structure, or what stands in its place."""

import functools
import json
import os
import shutil
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml
from hostile_formats import CSV, MCAP, ONNX, ZIP
from hostile_runs import Place
from hostile_structures import json_edits, yaml_edits
from pickles import PICKLES

Generator = np.random.Generator
Change = Callable[[Path, Place, Generator], None]
"""Changes a file where it stands."""


def flip(rng: Generator, data: bytes) -> bytes:
    changed = bytearray(data or b"\0")
    for place in rng.integers(8 * len(changed), size=rng.choice([1, 1, 3, 40])):
        changed[place // 8] ^= 1 << place % 8
    return bytes(changed)


def truncate(rng: Generator, data: bytes) -> bytes:
    return data[: rng.integers(len(data))] if data else data


def cut_out(rng: Generator, data: bytes) -> bytes:
    place = int(rng.integers(len(data) + 1))
    return data[:place] + data[place + int(rng.choice([1, 9, 512, 4096])) :]


def repeat(rng: Generator, data: bytes) -> bytes:
    place, size = int(rng.integers(len(data) + 1)), int(rng.choice([1, 9, 512, 4096]))
    return (
        data[: place + size]
        + data[place : place + size] * int(rng.choice([1, 3, 1000]))
        + data[place + size :]
    )


def zero(rng: Generator, data: bytes) -> bytes:
    place, size = int(rng.integers(len(data) + 1)), int(rng.choice([1, 8, 512, 10**9]))
    return data[:place] + bytes(len(data[place : place + size])) + data[place + size :]


def append(rng: Generator, data: bytes) -> bytes:
    tails = (
        b"\0",
        b"\n\n",
        b"\xff\xfe",
        b"garbage",
        bytes(100_000),
        data[:5000],
        b"\x1a",
        "é".encode("latin-1"),
    )
    return data + tails[rng.integers(len(tails))]


BYTES = {
    "flip": flip, "truncate": truncate, "cut out": cut_out, "repeat": repeat, "zero": zero, "append": append,
    "noise": lambda rng, data: rng.bytes(len(data)),
    "all zeros": lambda rng, data: bytes(len(data)),
    "no utf-8": lambda rng, data: data[: len(data) // 2] + b"\xff\xc3\x28" + data[len(data) // 2 :],
    "enlarged": lambda rng, data: data * 100,
    "64 MB of a letter": lambda rng, data: b"a" * 2**26,
    "64 MB of zeros at the end": lambda rng, data: data + bytes(2**26),
    "dashes": lambda rng, data: b"- " * 300_000,
    "brackets": lambda rng, data: b"[" * 300_000,
    "braces": lambda rng, data: b'{"a":' * 300_000,
}  # fmt: skip
"""Bytes to bytes, whatever is in them."""


def away(path: Path) -> None:
    """Remove it, whatever it is."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def instead(make: Callable[[Path, Place], None]) -> Change:
    def change(path: Path, place: Place, rng: Generator) -> None:
        away(path)
        make(path, place)

    return change


def a_folder(path: Path, place: Place) -> None:
    path.mkdir()
    (path / "mine.txt").write_text("my own\n")


def a_socket(path: Path, place: Place) -> None:
    here = os.open(path.parent, os.O_RDONLY)
    try:
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(f"/proc/self/fd/{here}/{path.name}"[:100])
    finally:
        os.close(here)


def linked_to_its_copy(path: Path, place: Place, rng: Generator) -> None:
    """The good file lies outside, and a link stands in its place: writing through it damages it."""
    outside = place.around / "outside" / path.name
    path.rename(outside)
    path.symlink_to(outside)


def folder_linked(path: Path, place: Place, rng: Generator) -> None:
    """The folder of the file is a link to one outside."""
    if path.parent != place.work:
        outside = place.around / "outside" / path.parent.name
        path.parent.rename(outside)
        path.parent.symlink_to(outside)


def another_format(path: Path, place: Place, rng: Generator) -> None:
    """The bytes of some other file of the workbench under this name."""
    others = sorted(
        other for other in place.work.rglob("*") if other.is_file() and other.suffix != path.suffix
    )
    path.write_bytes(others[rng.integers(len(others))].read_bytes())


REPLACED: dict[str, Change] = {
    "removed": instead(lambda path, place: None),
    "empty": instead(lambda path, place: path.touch()),
    "a folder": instead(a_folder),
    "a pipe": instead(lambda path, place: os.mkfifo(path)),
    "a socket": instead(a_socket),
    "link to nothing": instead(lambda path, place: path.symlink_to("nowhere")),
    "link to itself": instead(lambda path, place: path.symlink_to(path.name)),
    "link to another": instead(lambda path, place: path.symlink_to(place.precious)),
    "link to a folder": instead(lambda path, place: path.symlink_to(place.around / "outside")),
    "link to zeros": instead(lambda path, place: path.symlink_to("/dev/zero")),
    "link to noise": instead(lambda path, place: path.symlink_to("/dev/urandom")),
    "link to good": linked_to_its_copy,
    "folder is a link": folder_linked,
    "another format": another_format,
    "4 GB, sparse": lambda path, place, rng: os.truncate(path, 2**32),
    "read-only": lambda path, place, rng: path.chmod(0o444),
    "old": lambda path, place, rng: os.utime(path, (0, 0)),
    "of the year 2200": lambda path, place, rng: os.utime(path, (7.3e9, 7.3e9)),
}  # fmt: skip
"""Bytes or object put where the file was."""
if os.geteuid() != 0:
    REPLACED["unreadable"] = lambda path, place, rng: path.chmod(0)


def kind_of(path: Path) -> str:
    """Format of a good file, by its contents."""
    data = path.read_bytes()
    if data.startswith(b"PK"):
        return "zip"
    if data.startswith(b"\x89MCAP"):
        return "mcap"
    if path.suffix == ".onnx":
        return "onnx"
    if path.suffix == ".csv":
        return "csv"
    if data.startswith((b"{", b"[")) and is_json(data):
        return "json"
    if path.suffix in (".yaml", ".yml") and isinstance(yaml.safe_load(data), dict):
        return "yaml"
    return "other"


def is_json(data: bytes) -> bool:
    try:
        json.loads(data)
    except ValueError:
        return False
    return True


@functools.cache
def edits_of(kind: str) -> dict[str, Callable[[Generator, bytes], bytes]]:
    """Damage that belongs to a format."""
    of_kind = {"zip": ZIP, "mcap": MCAP, "onnx": ONNX, "csv": CSV}
    if kind == "json":
        return json_edits()
    return yaml_edits() if kind == "yaml" else of_kind.get(kind, {})


def mutations_of(kind: str) -> list[str]:
    """Names of all that can be done to a file of a format."""
    names = [*BYTES, *REPLACED, *edits_of(kind)]
    return names + [name for name in PICKLES if ("yaml" in name) <= (kind == "yaml")]


def mutate(path: Path, kind: str, mutation: str, place: Place, seed: int) -> None:
    """Damage a file; the same names and seed give the same damage."""
    rng = np.random.default_rng(seed)
    if mutation in REPLACED:
        REPLACED[mutation](path, place, rng)
        return
    data = path.read_bytes()
    if mutation in PICKLES:
        changed = PICKLES[mutation](data, place.canary)
    else:
        changed = (BYTES | edits_of(kind))[mutation](rng, data)
    path.write_bytes(changed)
