"""CSV tables, networks in ONNX, zip archives and MCAP files that are damaged as their formats allow."""

import io
import json
import struct
import zipfile
from collections.abc import Callable

import mutated
import numpy as np
from hostile_structures import EDITS, NUMBERS, TEXTS

Generator = np.random.Generator
Edit = Callable[[Generator, bytes], bytes]


def cells(rng: Generator, data: bytes, change: Callable[[list[list[str]], int, int], None]) -> bytes:
    """Change a table at a random row (not the header) and column."""
    rows = [line.split(",") for line in data.decode(errors="replace").splitlines()]
    row = int(rng.integers(1, len(rows))) if len(rows) > 1 else 0
    change(rows, row, int(rng.integers(len(rows[row]))))
    return ("\n".join(",".join(values) for values in rows) + "\n").encode(errors="replace")


def set_cell(values: tuple) -> Edit:
    def edit(rng: Generator, data: bytes) -> bytes:
        value = str(values[rng.integers(len(values))])
        return cells(rng, data, lambda rows, row, column: rows[row].__setitem__(column, value))

    return edit


def set_header(rng: Generator, data: bytes) -> bytes:
    value = ("", "time_s", "angle_deg", *TEXTS)[rng.integers(3 + len(TEXTS))]
    return cells(rng, data, lambda rows, row, column: rows[0].__setitem__(column % len(rows[0]), value))


def column_twice(rng: Generator, data: bytes) -> bytes:
    return cells(rng, data, lambda rows, row, at: rows[0].__setitem__(at % len(rows[0]), rows[0][0]))


def wide(rng: Generator, data: bytes) -> bytes:
    """Fifty thousand columns."""
    lines = data.splitlines()
    return b"\n".join(
        [
            lines[0] + b"," + b",".join(b"c%d" % k for k in range(50_000)),
            *(line + b",0" * 50_000 for line in lines[1:5]),
        ]
    )


def long(rng: Generator, data: bytes) -> bytes:
    lines = data.splitlines()
    return b"\n".join([lines[0], *lines[1:] * (500_000 // len(lines))])


CSV: dict[str, Edit] = {
    "csv: one more field": lambda rng, data: cells(rng, data, lambda rows, at, column: rows[at].append("1")),
    "csv: one field less": lambda rng, data: cells(rng, data, lambda rows, at, column: rows[at].pop(column)),
    "csv: decimal commas": lambda rng, data: data.replace(b".", b","),
    "csv: semicolons": lambda rng, data: data.replace(b",", b";").replace(b".", b","),
    "csv: tabs": lambda rng, data: data.replace(b",", b"\t"),
    "csv: number": set_cell((*NUMBERS[:11], "1e400", "-0", "1_000", "0x10", "1d5", " 3 ", "\u0661")),
    "csv: text": set_cell(TEXTS),
    "csv: quote": set_cell(('"', '"1', '1"2', '"a""b"', "'1'", '"1\n2"')),
    "csv: header": set_header,
    "csv: column twice": column_twice,
    "csv: no header": lambda rng, data: b"\n".join(data.splitlines()[1:]),
    "csv: header alone": lambda rng, data: data.splitlines()[0],
    "csv: byte order mark": lambda rng, data: b"\xef\xbb\xbf" + data,
    "csv: utf-16": lambda rng, data: data.decode(errors="replace").encode("utf-16"),
    "csv: latin-1": lambda rng, data: data.replace(b"angle", "ängle".encode("latin-1"), 1),
    "csv: NUL": lambda rng, data: data.replace(b"0", b"\0", 3),
    "csv: carriage returns": lambda rng, data: data.replace(b"\n", b"\r"),
    "csv: time goes back": lambda rng, data: b"\n".join([*data.splitlines(), *data.splitlines()[1:3]]),
    "csv: wide": wide,
    "csv: half a million rows": long,
    "csv: a long field": lambda rng, data: data + b"1," + b"9" * 5_000_000 + b",1\n",
}  # fmt: skip


def network(change: Callable[[Generator, "object"], None]) -> Edit:
    def edit(rng: Generator, data: bytes) -> bytes:
        import onnx

        model = onnx.load_from_string(data)
        change(rng, model)
        return model.SerializeToString()

    return edit


def reshape_input(rng: Generator, model) -> None:
    sides = [*model.graph.input, *model.graph.output]
    value = sides[rng.integers(len(sides))]
    dimensions = value.type.tensor_type.shape.dim
    if dimensions and rng.random() < 0.6:
        dimensions[rng.integers(len(dimensions))].dim_value = int(rng.choice([0, 1, 7, 100_000]))
    elif rng.random() < 0.5 and dimensions:
        del dimensions[-1]
    else:
        dimensions.add().dim_value = int(rng.choice([1, 3]))


def retype_input(rng: Generator, model) -> None:
    sides = [*model.graph.input, *model.graph.output]
    sides[rng.integers(len(sides))].type.tensor_type.elem_type = int(rng.choice([1, 7, 8, 9, 11]))


def rename_input(rng: Generator, model) -> None:
    sides = [*model.graph.input, *model.graph.output]
    sides[rng.integers(len(sides))].name = "other"


def spoil_weights(rng: Generator, model) -> None:
    """Weights that are infinite, not numbers, or fewer than the shape says."""
    tensor = model.graph.initializer[rng.integers(len(model.graph.initializer))]
    count = len(tensor.raw_data) // 4
    if rng.random() < 0.3:
        tensor.raw_data = tensor.raw_data[: len(tensor.raw_data) // 2]
    else:
        tensor.raw_data = struct.pack("<f", rng.choice([np.nan, np.inf, 1e38])) * count


def weights_elsewhere(rng: Generator, model) -> None:
    """Weights that are said to lie in another file."""
    tensor = model.graph.initializer[0]
    tensor.data_location = 1
    for key, value in (
        ("location", str(rng.choice(["../outside/precious.txt", "/etc/passwd", "weights"]))),
        ("offset", "0"),
    ):
        entry = tensor.external_data.add()
        entry.key, entry.value = key, value


def spoil_metadata(rng: Generator, model) -> None:
    """Metadata of the model: a key left out, or a value damaged as text, number or JSON."""
    entries = model.metadata_props
    if not entries:
        return
    index = int(rng.integers(len(entries)))
    if rng.random() < 0.25:
        del entries[index]
    elif rng.random() < 0.4:
        entries[index].value = str(
            (*TEXTS, *NUMBERS, "[" * 100_000, "{}", "[]", "null")[rng.integers(len(TEXTS) + len(NUMBERS) + 4)]
        )
    else:
        name = list(EDITS)[rng.integers(len(EDITS))]
        try:
            entries[index].value = json.dumps(EDITS[name](rng, json.loads(entries[index].value)))
        except (ValueError, TypeError):
            entries[index].value = "text"


def add_nodes(rng: Generator, model) -> None:
    """An operator that there is not, or one that makes an array of terabytes."""
    import onnx

    if rng.random() < 0.5:
        model.graph.node[rng.integers(len(model.graph.node))].op_type = "NoSuchOperator"
        return
    size = onnx.helper.make_tensor("huge", 7, [3], [100_000, 10_000, 1000])
    model.graph.initializer.append(size)
    model.graph.node.insert(0, onnx.helper.make_node("ConstantOfShape", ["huge"], ["bomb"]))
    model.graph.output.append(onnx.helper.make_tensor_value_info("bomb", 1, None))


ONNX: dict[str, Edit] = {
    "onnx: shape": network(reshape_input),
    "onnx: type": network(retype_input),
    "onnx: name": network(rename_input),
    "onnx: weights": network(spoil_weights),
    "onnx: weights elsewhere": network(weights_elsewhere),
    "onnx: metadata": network(spoil_metadata),
    "onnx: nodes": network(add_nodes),
    "onnx: no metadata": network(lambda rng, model: model.ClearField("metadata_props")),
}


def archive(change: Callable[[Generator, str, bytes], tuple[str, bytes]]) -> Edit:
    """Change one member of a zip file."""

    def edit(rng: Generator, data: bytes) -> bytes:
        made = io.BytesIO()
        with (
            zipfile.ZipFile(io.BytesIO(data)) as old,
            zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new,
        ):
            names = old.namelist()
            chosen = names[rng.integers(len(names))] if names else ""
            for name in names:
                content = old.read(name)
                new.writestr(*(change(rng, name, content) if name == chosen else (name, content)))
        return made.getvalue()

    return edit


def array_header(rng: Generator, name: str, content: bytes) -> tuple[str, bytes]:
    """A header that claims another shape or type than the data have."""
    if not content.startswith(b"\x93NUMPY"):
        return name, content[: len(content) // 2]
    size = 10 + int.from_bytes(content[8:10], "little")
    shape = [b"(1000000000000,)", b"(0,)", b"(-1,)", b"()", b"(2, 2, 2, 2)"][rng.integers(5)]
    kind = [b"'<f8'", b"'|O'", b"'<U9'", b"'<c16'", b"'|V8'", b"'<M8[s]'"][rng.integers(6)]
    head = (b"{'descr': %s, 'fortran_order': False, 'shape': %s, }" % (kind, shape)).ljust(size - 11) + b"\n"
    return name, content[:8] + len(head).to_bytes(2, "little") + head + content[size:]


def other_values(rng: Generator, name: str, content: bytes) -> tuple[str, bytes]:
    if not content.startswith(b"\x93NUMPY"):
        return name, b"{}"
    made = io.BytesIO()
    values = [
        np.array(np.nan),
        np.zeros(0),
        np.full(7, np.inf),
        np.array(["text"]),
        np.zeros((3, 3), bool),
        np.array(10**18),
    ]
    np.save(made, values[rng.integers(len(values))])
    return name, made.getvalue()


def bomb(rng: Generator, data: bytes) -> bytes:
    """Every name of the archive, the first of which unpacks to 1.2 GB of zeros, which an array may hold."""
    with zipfile.ZipFile(io.BytesIO(data)) as old:
        names = old.namelist() or ["data"]
        contents = {name: old.read(name) for name in names}
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (150000000,), }".ljust(117) + b"\n"
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as new:
        for name in names[1:]:
            new.writestr(name, contents[name])
        with new.open(names[0], "w") as member:
            if names[0].endswith(".npy"):
                member.write(b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head)
            for _ in range(120):
                member.write(bytes(10_000_000))
    return made.getvalue()


ZIP: dict[str, Edit] = {
    "zip: member left out": archive(lambda rng, name, content: (f"{name}_", content)),
    "zip: member empty": archive(lambda rng, name, content: (name, b"")),
    "zip: bomb": bomb,
    "zip: path": archive(lambda rng, name, content: (f"../../{name}", content)),
    "zip: header of array": archive(array_header),
    "zip: other values": archive(other_values),
    "zip: no member": lambda rng, data: b"PK\x05\x06" + bytes(18),
}


def mcap_metadata(rng: Generator, data: bytes) -> bytes:
    """One value of the metadata damaged as JSON is, the CRCs right."""
    parts = mutated.records(data)
    places = [index for index, part in enumerate(parts) if part[0] == 12]
    if not places:
        return data
    place = places[0]
    head, items = metadata_items(parts[place])
    key = list(items)[rng.integers(len(items))]
    name = list(EDITS)[rng.integers(len(EDITS))]
    try:
        items[key] = json.dumps(EDITS[name](rng, json.loads(items[key])))
    except (ValueError, TypeError):
        items[key] = TEXTS[rng.integers(len(TEXTS))]
    body = b"".join(text(key) + text(value) for key, value in items.items())
    grown = mutated.record(12, head + struct.pack("<I", len(body)) + body)
    parts[place] = grown
    return mutated.with_crcs(mutated.MAGIC + b"".join(parts))


def metadata_items(part: bytes) -> tuple[bytes, dict[str, str]]:
    (size,) = struct.unpack_from("<I", part, 9)
    head, at, items = part[9 : 13 + size], 17 + size, []
    while at < len(part):
        (size,) = struct.unpack_from("<I", part, at)
        items.append(part[at + 4 : at + 4 + size].decode())
        at += 4 + size
    return head, dict(zip(items[::2], items[1::2], strict=True))


def text(value: str) -> bytes:
    data = value.encode(errors="replace")
    return struct.pack("<I", len(data)) + data


MCAP: dict[str, Edit] = {
    "mcap: metadata": mcap_metadata,
    "mcap: inside a chunk": mutated.inside_chunk,
    "mcap: records": mutated.move_records,
    "mcap: lengths": mutated.set_number,
    "mcap: no CRCs": lambda rng, data: mutated.without_crcs(mutated.flip(rng, data)),
    "mcap: CRCs right": lambda rng, data: mutated.with_crcs(mutated.move_records(rng, data)),
}
