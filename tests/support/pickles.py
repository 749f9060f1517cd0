"""Pickles that leave a trace when they are loaded, in every wrapping that a program may load one from."""

import base64
import io
import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path


class Canary:
    """Loading its pickle makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = str(path)

    def __reduce__(self) -> tuple:
        return open, (self.path, "w")


def planted_pickle(canary: Path) -> bytes:
    return pickle.dumps(Canary(canary))


def planted_zip(canary: Path) -> bytes:
    """As torch and stable-baselines3 save: an archive of pickles."""
    names = ("data", "policy.pth", "archive/data.pkl", "weights.npy")
    return zipped(dict.fromkeys(names, planted_pickle(canary)))


def zipped(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def serialized(canary: Path) -> bytes:
    """A checkpoint as stable-baselines3 writes it, whose JSON holds pickles."""
    code = base64.b64encode(planted_pickle(canary)).decode()
    entry = {":type:": "<class 'function'>", ":serialized:": code}
    values = dict.fromkeys(("policy_class", "lr_schedule", "clip_range"), entry)
    return zipped({"data": json.dumps(values).encode()})


def npy(canary: Path) -> bytes:
    """An array of objects, which are pickles inside."""
    head = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"
    head += b" " * (63 - (len(head) + 10) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + pickle.dumps([Canary(canary)])


def in_yaml(canary: Path) -> bytes:
    return b"!!python/object/apply:builtins.open [" + json.dumps(str(canary)).encode() + b", w]\n"


PICKLES: dict[str, Callable[[bytes, Path], bytes]] = {
    "pickle": lambda data, canary: planted_pickle(canary),
    "pickle, protocol 0": lambda data, canary: pickle.dumps(Canary(canary), protocol=0),
    "pickles in a zip": lambda data, canary: planted_zip(canary),
    "pickle in data": lambda data, canary: serialized(canary),
    "pickle in npz": lambda data, canary: zipped({"arr_0.npy": npy(canary)}),
    "pickle in npy": lambda data, canary: npy(canary),
    "python in yaml": lambda data, canary: in_yaml(canary),
    "python in a value of yaml": lambda data, canary: data.rstrip() + b"\nextra: " + in_yaml(canary),
}
"""Ways to wrap one: bytes of a good file and the canary's path, to bytes."""
