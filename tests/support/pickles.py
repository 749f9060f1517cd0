"""Pickles that leave a trace when they are loaded, in every wrapping that a program may load one from."""

import base64
import io
import json
import pickle
import zipfile
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
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in ("data", "policy.pth", "archive/data.pkl", "weights.npy"):
            archive.writestr(name, planted_pickle(canary))
    return buffer.getvalue()


def plain(data: bytes, canary: Path) -> bytes:
    return planted_pickle(canary)


def old_protocol(data: bytes, canary: Path) -> bytes:
    return pickle.dumps(Canary(canary), protocol=0)


def every_member(data: bytes, canary: Path) -> bytes:
    """A zip with the same members, each a pickle; of a file that is no zip, as torch names them."""
    return rezipped(data, lambda name, content: pickle.dumps(Canary(canary)))


def serialized_data(data: bytes, canary: Path) -> bytes:
    """A checkpoint as stable-baselines3 writes it, whose JSON holds pickles."""
    code = base64.b64encode(pickle.dumps(Canary(canary))).decode()
    entry = {":type:": "<class 'function'>", ":serialized:": code}

    def planted(name: str, content: bytes) -> bytes:
        if name != "data":
            return content
        try:
            values = json.loads(content)
        except ValueError:
            values = {"policy_class": None, "lr_schedule": None, "clip_range": None}
        return json.dumps(dict.fromkeys(values, entry)).encode()

    return rezipped(data, planted, also="data")


def object_array(data: bytes, canary: Path) -> bytes:
    """The arrays of an npz file as arrays of objects, which are pickles inside."""
    return rezipped(data, lambda name, content: npy(canary), also="arr_0.npy")


def lone_array(data: bytes, canary: Path) -> bytes:
    return npy(canary)


def npy(canary: Path) -> bytes:
    head = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"
    head += b" " * (63 - (len(head) + 10) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + pickle.dumps([Canary(canary)])


def yaml_object(data: bytes, canary: Path) -> bytes:
    return b"!!python/object/apply:builtins.open [" + json.dumps(str(canary)).encode() + b", w]\n"


def yaml_value(data: bytes, canary: Path) -> bytes:
    """One more key, whose value is an object of Python."""
    return (
        data.rstrip()
        + b"\nextra: !!python/object/apply:builtins.open ["
        + json.dumps(str(canary)).encode()
        + b", w]\n"
    )


def rezipped(data: bytes, change, also: str = "archive/data.pkl") -> bytes:
    made = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            members = {name: old.read(name) for name in old.namelist()}
    except (zipfile.BadZipFile, ValueError):
        members = {}
    with zipfile.ZipFile(made, "w") as new:
        for name, content in ({also: b""} | members).items():
            new.writestr(name, change(name, content))
    return made.getvalue()


PICKLES = {
    "pickle": plain,
    "pickle, protocol 0": old_protocol,
    "pickle in every member": every_member,
    "pickle in data": serialized_data,
    "pickle in npz": object_array,
    "pickle in npy": lone_array,
    "python in yaml": yaml_object,
    "python in a value of yaml": yaml_value,
}
"""Ways to wrap one: bytes of a good file and the canary's path, to bytes."""
