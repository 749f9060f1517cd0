"""Check of an ONNX file before it is run: operators, sizes and parts that no training of ours writes.

Only the outline of the Protobuf message is read (https://onnx.ai/onnx/repo-docs/IR.html). A graph that loops,
calls functions, names other files or grows without bound is refused before ONNX Runtime sees it: its
optimizer would run constant parts of it at once.
"""

import math
from collections.abc import Iterator

from twin.errors import InputError
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

_MODEL = {1, 2, 3, 4, 5, 6, 7, 8, 14}
_GRAPH = {1, 2, 5, 10, 11, 12, 13, 16}
_ATTRIBUTE = {1, 2, 3, 4, 5, 7, 8, 9, 13, 20}  # no subgraphs, sparse tensors or references
_TENSOR = {1, 2, 4, 5, 7, 8, 9, 10, 11, 12}  # no text, no data in other files
_PARTS = {"model": _MODEL, "graph": _GRAPH, "attribute": _ATTRIBUTE, "tensor": _TENSOR}


def check_graph(content: bytes) -> None:
    """Refuse an ONNX file that holds what no training of ours writes."""
    outline = _Outline()
    for number, value in outline.parts("model", memoryview(content)):
        if number == 7:
            _check_graph(outline, _message(value))


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


def _check_graph(outline: _Outline, data: memoryview) -> None:
    for number, value in outline.parts("graph", data):
        if number == 1:
            _check_node(outline, _message(value))
        elif number == 5:
            _check_tensor(outline, _message(value))


def _check_node(outline: _Outline, data: memoryview) -> None:
    operator = domain = ""
    for number, value in outline.all_fields(data):
        if number == 4:
            operator = bytes(_message(value)).decode(errors="replace")
        elif number == 7:
            domain = bytes(_message(value)).decode(errors="replace")
        elif number == 5:
            for part, inner in outline.parts("attribute", _message(value)):
                if part == 5:
                    _check_tensor(outline, _message(inner))
    if operator not in OPERATORS or domain not in ("", "ai.onnx"):
        raise InputError(
            f"it has the operator {cut(f'{domain} {operator}', 40)}, which training never writes"
        )
    outline.nodes += 1
    outline.concatenations += operator == "Concat"
    if outline.nodes > MOST_NODES or outline.concatenations > MOST_CONCATENATIONS:
        raise InputError(f"it has more than {MOST_NODES} operators, or {MOST_CONCATENATIONS} of Concat")


def _check_tensor(outline: _Outline, data: memoryview) -> None:
    shape: list[int] = []
    for number, value in outline.parts("tensor", data):
        if number == 1 and isinstance(value, int):
            shape.append(value)
        elif number == 1:
            packed, place = _message(value), 0
            while place < len(packed):
                length, place = _varint(packed, place)
                shape.append(length)
    if len(shape) > 4 or max(shape, default=0) > LONGEST_AXIS or math.prod(shape) > LONGEST_AXIS**2 / 4:
        raise InputError(f"it has an array of shape {cut(shape, 40)}: training writes smaller ones")


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
