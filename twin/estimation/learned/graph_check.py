"""Check of an ONNX file before it is run: operators, sizes and parts that no training of ours writes.

Only the outline of the Protobuf message is read (https://onnx.ai/onnx/repo-docs/IR.html). A graph that loops,
calls functions, names other files or grows without bound (`graph_size`) is refused before ONNX Runtime sees
it: its optimizer would run constant parts of it at once.
"""

import math
import struct
from collections.abc import Iterator

from twin.errors import InputError
from twin.estimation.learned.graph_size import BATCH, Node, Shape, check_size
from twin.files.shown import cut

_LAYERS = {"Gemm", "MatMul", "Sigmoid", "Softmax", "Tanh"}
_ARITHMETIC = {"Add", "Div", "Max", "Min", "Mul", "Neg", "Sub", "ReduceMax", "ReduceMean", "ReduceSum"}
_FUNCTIONS = {"Abs", "Asinh", "Clip", "Exp", "Log", "Pow", "Relu", "Sign", "Sqrt", "IsNaN", "Not", "Where"}
_OF_SHAPE = {"Cast", "Concat", "Constant", "Gather", "Identity", "Split", "Squeeze", "Transpose", "Unsqueeze"}
OPERATORS = _LAYERS | _ARITHMETIC | _FUNCTIONS | _OF_SHAPE
"""Operators of the networks that training writes, and near ones that another torch may write for the same."""
MOST_NODES = 600
MOST_CONCATENATIONS = 4  # number of `Concat` nodes: each may double what it is given
LONGEST_AXIS = 8192
MOST_FIELDS = 100_000

MOST_NUMBERS = 4096  # bytes of a constant that are read as whole numbers: axes and lengths
INT64 = 7  # kind of a tensor
_Tensor = tuple[str, Shape, tuple[int, ...]]  # name, shape, and numbers of a tensor of whole numbers

_MODEL = {1, 2, 3, 4, 5, 6, 7, 8, 14}
_GRAPH = {1, 2, 5, 10, 11, 12, 13, 16}
_ATTRIBUTE = {1, 2, 3, 4, 5, 7, 8, 9, 13, 20}  # no subgraphs, sparse tensors or references
_TENSOR = {1, 2, 4, 5, 7, 8, 9, 10, 11, 12}  # no text, no data in other files
_PARTS = {"model": _MODEL, "graph": _GRAPH, "attribute": _ATTRIBUTE, "tensor": _TENSOR}


def check_graph(content: bytes) -> dict[str, Shape]:
    """Refuse an ONNX file that holds what no training of ours writes; return the shapes of its arrays."""
    outline = _Outline()
    shapes: dict[str, Shape] = {}
    for number, value in outline.parts("model", memoryview(content)):
        if number == 7:
            shapes = _check_graph(outline, _message(value))
    return shapes


class _Outline:
    """Reader of Protobuf messages that counts what it has read."""

    def __init__(self) -> None:
        self.fields = self.nodes = self.concatenations = 0

    def parts(self, kind: str, data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
        for number, value in self.all_fields(data):
            if number not in _PARTS[kind]:
                raise InputError(f"its {kind} has a part (field {number}) that training never writes")
            yield number, value

    def all_fields(self, data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
        """Yield number and value of each field of a message: a whole number, or bytes."""
        place = 0
        while place < len(data):
            self.fields += 1
            if self.fields > MOST_FIELDS:
                raise InputError(f"it has more than {MOST_FIELDS} parts")
            key, place = _varint(data, place)
            number, wire = key >> 3, key & 7
            if wire == 0:
                value, place = _varint(data, place)
                yield number, value
                continue
            if wire == 2:
                size, place = _varint(data, place)
            elif wire in (1, 5):
                size = 8 if wire == 1 else 4
            else:
                raise InputError("it is no ONNX file: a part is of an unknown kind")
            if size > len(data) - place:
                raise InputError("it is cut off")
            yield number, data[place : place + size]
            place += size


def _check_graph(outline: _Outline, data: memoryview) -> dict[str, Shape]:
    nodes: list[Node] = []
    shapes: dict[str, Shape] = {}
    constants: dict[str, tuple[int, ...]] = {}
    for number, value in outline.parts("graph", data):
        if number == 1:
            node, tensor = _read_node(outline, _message(value))
            if tensor is None:
                nodes.append(node)
            else:
                shapes[node.outputs[0]], constants[node.outputs[0]] = tensor[1:]
        elif number == 5:
            name, shape, numbers = _read_tensor(outline, _message(value))
            shapes[name], constants[name] = shape, numbers
        elif number == 11:
            name, shape = _read_input(outline, _message(value))
            shapes[name] = shape
    return check_size(nodes, shapes, constants)


def _read_node(outline: _Outline, data: memoryview) -> tuple[Node, _Tensor | None]:
    """Return an operator; where it is a constant, its array too."""
    operator = domain = ""
    names: dict[int, list[str]] = {1: [], 2: []}
    numbers: dict[str, tuple[int, ...]] = {}
    tensor = None
    for number, value in outline.all_fields(data):
        if number in names:
            names[number].append(_text(value))
        elif number == 4:
            operator = _text(value)
        elif number == 7:
            domain = _text(value)
        elif number == 5:
            attribute, found = "", []
            for part, inner in outline.parts("attribute", _message(value)):
                if part == 1:
                    attribute = _text(inner)
                elif part == 5:
                    tensor = _read_tensor(outline, _message(inner))
                elif part in (3, 8):
                    found += _numbers(inner)
            numbers[attribute] = tuple(found)
    if operator not in OPERATORS or domain not in ("", "ai.onnx"):
        raise InputError(
            f"it has the operator {cut(f'{domain} {operator}', 40)}, which training never writes"
        )
    outline.nodes += 1
    outline.concatenations += operator == "Concat"
    if outline.nodes > MOST_NODES or outline.concatenations > MOST_CONCATENATIONS:
        raise InputError(f"it has more than {MOST_NODES} operators, or {MOST_CONCATENATIONS} of Concat")
    if operator == "Constant" and (tensor is None or not names[2]):
        raise InputError("it has a constant that training never writes")
    node = Node(operator, tuple(names[1]), tuple(names[2]), numbers)
    return node, tensor if operator == "Constant" else None


def _read_tensor(outline: _Outline, data: memoryview) -> _Tensor:
    shape: list[int] = []
    name, kind, numbers, raw = "", 0, list[int](), b""
    for number, value in outline.parts("tensor", data):
        if number == 1:
            shape += _numbers(value)
        elif number == 2:
            kind = _numbers(value)[0]
        elif number == 7:
            numbers += _numbers(value)
        elif number == 8:
            name = _text(value)
        elif number == 9:
            raw = bytes(_message(value)[:MOST_NUMBERS])
    if len(shape) > 4 or max(shape, default=0) > LONGEST_AXIS or math.prod(shape) > LONGEST_AXIS**2 / 4:
        raise InputError(f"it has an array of shape {cut(shape, 40)}: training writes smaller ones")
    if kind == INT64 and not numbers:
        numbers = [of for (of,) in struct.iter_unpack("<q", raw[: len(raw) // 8 * 8])]
    return name, tuple(shape), tuple(numbers)


def _read_input(outline: _Outline, data: memoryview) -> tuple[str, Shape]:
    """Return name and shape of an input; an axis of any length is `BATCH` long."""
    name, shape = "", list[int]()
    for number, value in outline.all_fields(data):
        if number == 1:
            name = _text(value)
        elif number == 2:
            for axis in _within(outline, _message(value), (1, 2, 1)):
                length = [of for part, of in outline.all_fields(axis) if part == 1]
                shape += _numbers(length[0]) if length else [BATCH]
    return name, tuple(shape)


def _within(outline: _Outline, data: memoryview, path: tuple[int, ...]) -> Iterator[memoryview]:
    """Yield the messages inside a message, along numbers of fields."""
    for number, value in outline.all_fields(data):
        if number == path[0]:
            inner = _message(value)
            yield from _within(outline, inner, path[1:]) if path[1:] else (inner,)


def _text(value: int | memoryview) -> str:
    return bytes(_message(value)).decode(errors="replace")


def _numbers(value: int | memoryview) -> list[int]:
    """Return whole numbers of a field: one, or several packed."""
    found, place = [], 0
    if isinstance(value, int):
        found = [value]
    else:
        while place < len(value):
            number, place = _varint(value, place)
            found.append(number)
    return [number - 2**64 if number >= 2**63 else number for number in found]


def _message(value: int | memoryview) -> memoryview:
    if isinstance(value, int):
        raise InputError("it is no ONNX file: a number stands for a message")
    return value


def _varint(data: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    while place < len(data) and shift < 70:
        byte = data[place]
        place += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, place
        shift += 7
    raise InputError("it is cut off")
