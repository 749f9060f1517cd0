"""Damage to a file that a verb reads: its bytes, its structure, or what stands in its place."""

import json
import os
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pickles import PICKLES

Generator = np.random.Generator
Edit = Callable[[Generator, bytes], bytes]
"""Bytes of a good file to bytes of a bad one."""

NUMBERS = (float("nan"), float("inf"), -1, 0, 10**400, 2**63, 1e308, 5e-324, 1.5, True)
TEXTS = (
    "x" * 100_000,
    "two\nlines",
    "a\rb\x1b[31mred\x07\x00",
    "<script>alert(1)</script>",
    "../../outside/precious.txt",
    "\u202egnp.exe \ud83d\ude00 \u0000",
    "!!python/object/apply:os.system [true]",
    "",
    "1e400",
)
OTHERS = (None, [], {}, [[]], "text", 0, True, {"a": {"b": 1}}, 3.5)


def pick(rng: Generator, values: Any) -> Any:
    return values[rng.integers(len(values))]


def span(rng: Generator, data: bytes) -> tuple[int, int]:
    """A random place, and the end of what is damaged there."""
    at = int(rng.integers(len(data) + 1))
    return at, min(len(data), at + int(rng.choice([1, 9, 512, 4096])))


def flip(rng: Generator, data: bytes) -> bytes:
    changed = bytearray(data or b"\0")
    for place in rng.integers(8 * len(changed), size=rng.choice([1, 1, 3, 40])):
        changed[place // 8] ^= 1 << place % 8
    return bytes(changed)


def cut_out(rng: Generator, data: bytes) -> bytes:
    at, end = span(rng, data)
    return data[:at] + data[end:]


def repeat(rng: Generator, data: bytes) -> bytes:
    at, end = span(rng, data)
    return data[:end] + data[at:end] * int(rng.choice([1, 3, 1000])) + data[end:]


def zero(rng: Generator, data: bytes) -> bytes:
    at, end = span(rng, data)
    return data[:at] + bytes(end - at) + data[end:]


BYTES: dict[str, Edit] = {
    "flip": flip,
    "truncate": lambda rng, data: data[: rng.integers(len(data))] if data else data,
    "cut out": cut_out,
    "repeat": repeat,
    "zero": zero,
    "append": lambda rng, data: data + pick(rng, (b"\0", b"\n\n", b"\xff\xfe", bytes(100_000), data[:5000])),
    "noise": lambda rng, data: rng.bytes(len(data)),
    "no utf-8": lambda rng, data: data[: len(data) // 2] + b"\xff\xc3\x28" + data[len(data) // 2 :],
    "enlarged": lambda rng, data: data * 100,
    "64 MB of a letter": lambda rng, data: b"a" * 2**26,
    "64 MB of zeros at the end": lambda rng, data: data + bytes(2**26),
    "dashes": lambda rng, data: b"- " * 300_000,
    "brackets": lambda rng, data: b"[" * 300_000,
    "braces": lambda rng, data: b'{"a":' * 300_000,
}

Replace = Callable[[Path, Path], object]
"""Puts something in the place of a file that is gone; the second folder is no business of the command."""


def a_folder(path: Path, outside: Path) -> None:
    path.mkdir()
    (path / "mine.txt").write_text("my own\n")


REPLACED: dict[str, Replace] = {
    "removed": lambda path, outside: None,
    "empty": lambda path, outside: path.touch(),
    "a folder": a_folder,
    "a pipe": lambda path, outside: os.mkfifo(path),
    "link to nothing": lambda path, outside: path.symlink_to(outside / "new"),
    "link to itself": lambda path, outside: path.symlink_to(path.name),
    "link to another": lambda path, outside: path.symlink_to(outside / "precious.txt"),
    "link to a folder": lambda path, outside: path.symlink_to(outside),
    "link to zeros": lambda path, outside: path.symlink_to("/dev/zero"),
    "link to noise": lambda path, outside: path.symlink_to("/dev/urandom"),
}


def link_to_good(path: Path, outside: Path) -> None:
    """The good file lies outside, and a link stands in its place: writing through it damages it."""
    path.rename(outside / path.name)
    path.symlink_to(outside / path.name)


CHANGED: dict[str, Replace] = {
    "link to good": link_to_good,
    "4 GB, sparse": lambda path, outside: os.truncate(path, 2**32),
    "read-only": lambda path, outside: path.chmod(0o444),
    "old": lambda path, outside: os.utime(path, (0, 0)),
    "of the year 2200": lambda path, outside: os.utime(path, (7.3e9, 7.3e9)),
}


def places_in(value: Any, at: tuple = ()) -> list[tuple]:
    """Keys that lead to each value inside."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, inside in items for place in ((*at, key), *places_in(inside, (*at, key)))]


def structured(load: Callable, dump: Callable, edit: Callable[[Generator, Any, Any], None]) -> Edit:
    """Call `edit(rng, container, key)` at a random value of a JSON or YAML file."""

    def change(rng: Generator, data: bytes) -> bytes:
        value = load(data)
        places = places_in(value)
        if places:
            *way, key = pick(rng, places)
            inside = value
            for step in way:
                inside = inside[step]
            edit(rng, inside, key)
        text = dump(value)
        for mark, raw in RAW.items():
            text = text.replace(f'"{mark}"', raw).replace(mark, raw)
        return text.encode(errors="replace")

    return change


RAW = {
    "MARK0": "[" * 50 + "1" + "]" * 50,
    "MARK1": "[" * 10_000,
    "MARK2": '{"a":' * 200_000,
    "MARK3": "[" + ",".join(["1"] * 1_000_000) + "]",
    "MARK4": "9" * 200_000,
}
"""Texts that no writer would write, each by the mark that it replaces."""


def set_to(values: tuple) -> Callable[[Generator, Any, Any], None]:
    return lambda rng, inside, key: inside.__setitem__(key, pick(rng, values))


def rename(rng: Generator, inside: Any, key: Any) -> None:
    if isinstance(inside, dict):
        inside[pick(rng, TEXTS) if rng.random() < 0.5 else f"{key}_"] = inside.pop(key)


STRUCTURES = {
    "delete": lambda rng, inside, key: inside.__delitem__(key),
    "retype": set_to(OTHERS),
    "number": set_to(NUMBERS),
    "text": set_to(TEXTS),
    "raw": set_to(tuple(RAW)),
    "rename": rename,
}
ALIASES = b"a0: &a0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]\n" + b"".join(
    b"a%d: &a%d [" % (n, n) + b", ".join([b"*a%d" % (n - 1)] * 9) + b"]\n" for n in range(1, 30)
)
JSON: dict[str, Edit] = {
    f"json: {name}": structured(json.loads, json.dumps, edit) for name, edit in STRUCTURES.items()
} | {"json: key twice": lambda rng, data: data.rstrip()[:-1] + b', "seed": 1, "seed": 2}'}
YAML: dict[str, Edit] = {
    f"yaml: {name}": structured(yaml.safe_load, yaml.safe_dump, edit) for name, edit in STRUCTURES.items()
} | {
    "yaml: key twice": lambda rng, data: data + b"\n" + data.split(b":")[0] + b": 1\n",
    "yaml: alias bomb": lambda rng, data: ALIASES + data,
    "yaml: alias of itself": lambda rng, data: data + b"\nextra: &a [*a]\n",
    "yaml: two documents": lambda rng, data: data + b"\n---\n" + data,
    "yaml: merge": lambda rng, data: b"x: &x {episodes: 3}\n" + data + b"\n<<: *x\n",
    "yaml: tag": lambda rng, data: data + b"\nextra: !!binary aGk=\nother: !unknown {a: 1}\n",
    "yaml: date": lambda rng, data: data + b"\nextra: 2026-13-45\n2026-99-99: 1\n",
}


def cell(values: tuple) -> Edit:
    """Set a random cell of a table."""

    def change(rng: Generator, data: bytes) -> bytes:
        rows = [line.split(",") for line in data.decode(errors="replace").splitlines()]
        row = pick(rng, rows)
        row[rng.integers(len(row))] = str(pick(rng, values))
        return "\n".join(map(",".join, rows)).encode(errors="replace") + b"\n"

    return change


def repeated_row(rng: Generator, data: bytes) -> bytes:
    lines = data.splitlines()
    return b"\n".join([lines[0], *lines[1:] * (500_000 // len(lines))])


CSV: dict[str, Edit] = {
    "csv: number": cell((*NUMBERS[:9], "-0", "1_000", "0x10", "1d5", " 3 ", "\u0661", "1,2", "")),
    "csv: text": cell((*TEXTS, '"', '"1', '1"2', "'1'", '"1\n2"')),
    "csv: decimal commas": lambda rng, data: data.replace(b".", b","),
    "csv: semicolons": lambda rng, data: data.replace(b",", b";").replace(b".", b","),
    "csv: no header": lambda rng, data: data.partition(b"\n")[2],
    "csv: header alone": lambda rng, data: data.partition(b"\n")[0],
    "csv: byte order mark": lambda rng, data: b"\xef\xbb\xbf" + data,
    "csv: utf-16": lambda rng, data: data.decode(errors="replace").encode("utf-16"),
    "csv: NUL": lambda rng, data: data.replace(b"0", b"\0", 3),
    "csv: carriage returns": lambda rng, data: data.replace(b"\n", b"\r"),
    "csv: time goes back": lambda rng, data: b"\n".join([*data.splitlines(), *data.splitlines()[1:3]]),
    "csv: wide": lambda rng, data: data.replace(b"\n", b",0" * 50_000 + b"\n"),
    "csv: half a million rows": repeated_row,
    "csv: a long field": lambda rng, data: data + b"1," + b"9" * 5_000_000 + b",1\n",
}


def network(change: Callable[[Generator, Any], object]) -> Edit:
    def edit(rng: Generator, data: bytes) -> bytes:
        import onnx

        model = onnx.load_from_string(data)
        change(rng, model)
        return bytes(model.SerializeToString())

    return edit


def a_side(rng: Generator, model: Any) -> Any:
    return pick(rng, [*model.graph.input, *model.graph.output])


def reshape(rng: Generator, model: Any) -> None:
    sides = a_side(rng, model).type.tensor_type.shape.dim
    (pick(rng, sides) if len(sides) else sides.add()).dim_value = int(rng.choice([0, 1, 7, 100_000]))


def spoil_weights(rng: Generator, model: Any) -> None:
    """Weights that are infinite, not numbers, or fewer than the shape says."""
    tensor = pick(rng, model.graph.initializer)
    size = len(tensor.raw_data) // 4
    some = struct.pack("<f", rng.choice([np.nan, np.inf, 1e38])) * size
    tensor.raw_data = pick(rng, (some, tensor.raw_data[: 2 * size]))


def weights_elsewhere(rng: Generator, model: Any) -> None:
    tensor = model.graph.initializer[0]
    tensor.data_location = 1
    entry = tensor.external_data.add()
    entry.key, entry.value = "location", pick(rng, ("../outside/precious.txt", "/etc/passwd", "weights"))


def spoil_metadata(rng: Generator, model: Any) -> None:
    """A value of the metadata damaged as text, number or JSON."""
    entry = pick(rng, model.metadata_props)
    try:
        entry.value = pick(rng, list(JSON.values()))(rng, entry.value.encode()).decode()
    except ValueError:
        entry.value = str(pick(rng, (*TEXTS[1:], *NUMBERS, "[" * 100_000, "{}", "null"))).replace(
            "\ud83d", ""
        )


def add_nodes(rng: Generator, model: Any) -> None:
    """An operator that does not exist, or one that makes an array of terabytes."""
    import onnx

    if rng.random() < 0.5:
        pick(rng, model.graph.node).op_type = "NoSuchOperator"
        return
    model.graph.initializer.append(onnx.helper.make_tensor("huge", 7, [3], [100_000, 10_000, 1000]))
    model.graph.node.insert(0, onnx.helper.make_node("ConstantOfShape", ["huge"], ["bomb"]))
    model.graph.output.append(onnx.helper.make_tensor_value_info("bomb", 1, None))


ONNX: dict[str, Edit] = {
    "onnx: shape": network(reshape),
    "onnx: type": network(
        lambda rng, model: setattr(a_side(rng, model).type.tensor_type, "elem_type", int(rng.choice([7, 9])))
    ),
    "onnx: name": network(lambda rng, model: setattr(a_side(rng, model), "name", "other")),
    "onnx: weights": network(spoil_weights),
    "onnx: weights elsewhere": network(weights_elsewhere),
    "onnx: metadata": network(spoil_metadata),
    "onnx: nodes": network(add_nodes),
    "onnx: no metadata": network(lambda rng, model: model.ClearField("metadata_props")),
}


def edits_of(path: Path) -> dict[str, Edit]:
    """Damage that fits the format of a good file."""
    return BYTES | {".json": JSON, ".yaml": YAML, ".csv": CSV, ".onnx": ONNX}.get(path.suffix, {})


def names_of(path: Path) -> list[str]:
    """Names of all that can be done to a good file."""
    wrapped = [name for name in PICKLES if "yaml" not in name or path.suffix == ".yaml"]
    return [*edits_of(path), *REPLACED, *CHANGED, *wrapped]


def damage(path: Path, name: str, outside: Path, canary: Path, seed: int) -> None:
    """Damage a file; the same name and seed give the same damage."""
    if name in REPLACED:
        remove(path)
        REPLACED[name](path, outside)
    elif name in CHANGED:
        CHANGED[name](path, outside)
    elif name in PICKLES:
        path.write_bytes(PICKLES[name](path.read_bytes(), canary))
    else:
        path.write_bytes(edits_of(path)[name](np.random.default_rng(seed), path.read_bytes()))


def remove(path: Path) -> None:
    """Remove it, whatever it is."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
