"""Size of a graph of ONNX: shapes of all its arrays, by the rules of its operators, before anything is run.

ONNX Runtime computes constant parts of a graph when it loads it. Two constants of 100 kB may be broadcast to
an array of gigabytes, and a chain of their products takes minutes: so shapes are found here first.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from twin.errors import InputError
from twin.files.shown import cut

BATCH = 2  # filters that a graph is tried on: an axis whose length is free
MOST_ELEMENTS = 2**22
"""Elements of all arrays of a graph together; those of a trained RAM (twins) are 140,000."""
MOST_PRODUCTS = 2**26
"""Multiplications in all products of matrices of a graph together."""

Shape = tuple[int, ...]


class Node(NamedTuple):
    """Operator of a graph."""

    operator: str
    inputs: tuple[str, ...]  # names; an empty one is left out
    outputs: tuple[str, ...]
    numbers: Mapping[str, tuple[int, ...]]  # attributes that are whole numbers, by name


class Given(NamedTuple):
    """What an operator is given."""

    shapes: Sequence[Shape]  # of its inputs, without those that are left out
    # whole numbers of each input, where it is a constant of such
    constants: Sequence[tuple[int, ...] | None]
    numbers: Mapping[str, tuple[int, ...]]

    def whole(self, name: str, place: int) -> tuple[int, ...] | None:
        """Return whole numbers that are an attribute, or an input that is a constant."""
        if name in self.numbers:
            return self.numbers[name]
        return self.constants[place] if place < len(self.constants) else None

    def number(self, name: str, default: int) -> int:
        """Return an attribute that is one whole number."""
        return self.numbers.get(name, (default,))[0]


def check_size(
    nodes: Sequence[Node], shapes: Mapping[str, Shape], constants: Mapping[str, tuple[int, ...]]
) -> dict[str, Shape]:
    """Return the shapes of all arrays by name; refuse what is larger than any that training writes.

    Known are the shapes of inputs and constants, and the whole numbers of small constants, by name.
    """
    known, elements, products = dict(shapes), 0, 0
    for node in nodes:
        names = [name for name in node.inputs if name]
        missing = [name for name in names if name not in known]
        if missing:
            raise InputError(f"its operator {node.operator} needs {cut(missing[0], 40)!r} before it is there")
        given = Given([known[name] for name in names], [constants.get(name) for name in names], node.numbers)
        try:
            found = _SHAPES.get(node.operator, _elementwise)(given, len(node.outputs))
        except (ValueError, IndexError, TypeError) as error:
            raise InputError(
                f"its operator {node.operator} is given arrays that do not fit: {cut(list(given.shapes), 80)}"
            ) from error
        if node.operator in ("Gemm", "MatMul"):
            products += math.prod(found[0]) * given.shapes[0][0 if given.number("transA", 0) else -1]
        elements += sum(map(math.prod, found))
        if elements > MOST_ELEMENTS or products > MOST_PRODUCTS:
            raise InputError(
                f"its arrays have more than {MOST_ELEMENTS} elements in all, or its products of matrices "
                f"more than {MOST_PRODUCTS} multiplications: training writes smaller ones"
            )
        known |= zip(node.outputs, found, strict=False)
    return known


def _elementwise(given: Given, outputs: int) -> list[Shape]:
    return [np.broadcast_shapes(*given.shapes)] * outputs


def _first(given: Given, outputs: int) -> list[Shape]:
    return [given.shapes[0]] * outputs


def _gemm(given: Given, outputs: int) -> list[Shape]:
    a, b = (
        shape[::-1] if given.number(name, 0) else shape
        for shape, name in zip(given.shapes[:2], ("transA", "transB"), strict=True)
    )
    return [_products(a, b)]


def _matmul(given: Given, outputs: int) -> list[Shape]:
    a, b = given.shapes
    shape = _products(a if len(a) > 1 else (1, *a), b if len(b) > 1 else (*b, 1))
    columns = shape[-1:] if len(b) > 1 else ()
    return [(*shape[:-2], *(shape[-2:-1] if len(a) > 1 else ()), *columns)]


def _products(a: Shape, b: Shape) -> Shape:
    if len(a) < 2 or len(b) < 2 or a[-1] != b[-2]:
        raise ValueError("no product")
    return (*np.broadcast_shapes(a[:-2], b[:-2]), a[-2], b[-1])


def _from_start(axes: Sequence[int], rank: int) -> list[int]:
    """Return axes counted from the first one; one that there is not raises `IndexError`."""
    return [range(rank)[axis] for axis in axes]


def _without(shape: Shape, axes: Sequence[int]) -> Shape:
    return tuple(length for axis, length in enumerate(shape) if axis not in axes)


def _reduced(given: Given, outputs: int) -> list[Shape]:
    shape, axes = given.shapes[0], given.whole("axes", 1)
    chosen = _from_start(range(len(shape)) if axes is None else axes, len(shape))
    if given.number("keepdims", 1):
        return [tuple(1 if axis in chosen else length for axis, length in enumerate(shape))]
    return [_without(shape, chosen)]


def _concatenated(given: Given, outputs: int) -> list[Shape]:
    shapes = given.shapes
    axis = range(len(shapes[0]))[given.number("axis", 0)]
    if len({_without(shape, [axis]) for shape in shapes}) > 1:
        raise ValueError("no concatenation")
    return [(*shapes[0][:axis], sum(shape[axis] for shape in shapes), *shapes[0][axis + 1 :])]


def _gathered(given: Given, outputs: int) -> list[Shape]:
    shape, indices = given.shapes
    axis = range(len(shape))[given.number("axis", 0)]
    return [(*shape[:axis], *indices, *shape[axis + 1 :])]


def _split(given: Given, outputs: int) -> list[Shape]:
    shape = given.shapes[0]
    axis = range(len(shape))[given.number("axis", 0)]
    each = -(-shape[axis] // outputs)
    sizes = given.whole("split", 1) or [min(each, shape[axis] - each * place) for place in range(outputs)]
    if len(sizes) != outputs or sum(sizes) != shape[axis] or min(sizes) < 0:
        raise ValueError("no split")
    return [(*shape[:axis], size, *shape[axis + 1 :]) for size in sizes]


def _squeezed(given: Given, outputs: int) -> list[Shape]:
    shape, axes = given.shapes[0], given.whole("axes", 1)
    if axes is None:
        axes = tuple(axis for axis, length in enumerate(shape) if length == 1)
    return [_without(shape, _from_start(axes, len(shape)))]


def _unsqueezed(given: Given, outputs: int) -> list[Shape]:
    shape, axes = given.shapes[0], given.whole("axes", 1)
    if axes is None:
        raise ValueError("no axes")
    rank = len(shape) + len(axes)
    new = _from_start(axes, rank)
    left = iter(shape)
    return [tuple(1 if axis in new else next(left) for axis in range(rank))]


def _transposed(given: Given, outputs: int) -> list[Shape]:
    shape = given.shapes[0]
    return [tuple(shape[axis] for axis in given.numbers.get("perm", range(len(shape))[::-1]))]


_SHAPES: dict[str, Callable[[Given, int], list[Shape]]] = {
    **dict.fromkeys(("Cast", "Clip", "Identity", "Softmax"), _first),
    **dict.fromkeys(("ReduceMax", "ReduceMean", "ReduceSum"), _reduced),
    "Concat": _concatenated,
    "Gather": _gathered,
    "Gemm": _gemm,
    "MatMul": _matmul,
    "Split": _split,
    "Squeeze": _squeezed,
    "Transpose": _transposed,
    "Unsqueeze": _unsqueezed,
}
"""Shapes of the outputs of operators; all others work element by element, and broadcast."""
