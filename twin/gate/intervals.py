"""Interval arithmetic through an ONNX graph: bounds that hold for every input of a box (Moore 1966).

Each tensor is enclosed by a lowest and a highest value of every element. Operators are enclosed one by one,
so that what two of them have in common is lost: an enclosure may be wide, it is never too narrow but for the
rounding of single precision, which the caller allows for. Ends may be infinite: a box need not be bounded.
"""

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]


class Box(NamedTuple):
    """Lowest and highest value of each element of a tensor.

    Attributes:
        low: (...).
        high: (...), nowhere below it.
    """

    low: Array
    high: Array

    @classmethod
    def at(cls, value: Any) -> "Box":
        """Return the box of one value alone."""
        point = np.asarray(value, dtype=float)
        return cls(point, point)


class UnsupportedOperatorError(InputError):
    """An operator that is not enclosed: its name is the text."""


def enclose(graph: Any, inputs: Mapping[str, Box]) -> dict[str, Box]:
    """Return the enclosure of every tensor of a graph.

    Args:
        graph: the `graph` of an ONNX model.
        inputs: box of each input.

    Raises:
        UnsupportedOperatorError: an operator is not known here.
    """
    from onnx import numpy_helper

    known = {part.name: Box.at(numpy_helper.to_array(part)) for part in graph.initializer} | dict(inputs)
    with np.errstate(all="ignore"):
        for node in graph.node:
            attributes = {part.name: _attribute(part) for part in node.attribute}
            given = [known[name] if name else None for name in node.input]
            known.update(zip(node.output, _enclosed(node.op_type, given, attributes), strict=False))
    return known


def _attribute(part: Any) -> Any:
    from onnx import helper, numpy_helper

    value = helper.get_attribute_value(part)
    return numpy_helper.to_array(value) if hasattr(value, "raw_data") else value


def _enclosed(operator: str, given: list[Box | None], attributes: dict[str, Any]) -> list[Box]:
    if operator in _RISING:
        (of,) = _there(given)
        return [_ordered(_RISING[operator](of.low), _RISING[operator](of.high))]
    if operator not in _OPERATORS:
        raise UnsupportedOperatorError(operator)
    found = _OPERATORS[operator](given, attributes)
    return found if isinstance(found, list) else [found]


def _there(given: list[Box | None]) -> list[Box]:
    return [of for of in given if of is not None]


def _ordered(low: Array, high: Array) -> Box:
    """Return a box; an end that is no number is as far as it can be."""
    return Box(
        np.nan_to_num(low, nan=-np.inf, posinf=np.inf, neginf=-np.inf),
        np.nan_to_num(high, nan=np.inf, posinf=np.inf, neginf=-np.inf),
    )


def _point(of: Box | None) -> Array:
    if of is None or not np.array_equal(of.low, of.high):
        raise UnsupportedOperatorError("an index or a shape that is computed")
    return of.low


def _whole(of: Box | None) -> tuple[int, ...]:
    return tuple(int(value) for value in np.atleast_1d(_point(of)))


def _times(one: Box, other: Box) -> Box:
    products = [a * b for a in one for b in other]
    products = [np.where(np.isnan(product), 0.0, product) for product in products]  # 0 times infinity: 0
    return Box(np.minimum.reduce(products), np.maximum.reduce(products))


def _plus(one: Box, other: Box) -> Box:
    return _ordered(one.low + other.low, one.high + other.high)


def _negative(of: Box) -> Box:
    return Box(-of.high, -of.low)


def _inverse(of: Box) -> Box:
    """Return 1 / x: an end that is zero is approached from within."""
    crosses = (of.low < 0) & (of.high > 0)
    high = np.where(of.low == 0, np.inf, 1 / of.low)
    low = np.where(of.high == 0, -np.inf, 1 / of.high)
    return Box(np.where(crosses, -np.inf, low), np.where(crosses, np.inf, high))


def _absolute(of: Box) -> Box:
    most = np.maximum(np.abs(of.low), np.abs(of.high))
    least = np.where((of.low <= 0) & (of.high >= 0), 0.0, np.minimum(np.abs(of.low), np.abs(of.high)))
    return Box(least, most)


def _summed(of: Box, axes: tuple[int, ...] | None, keep: bool) -> Box:
    return _ordered(*(end.sum(axis=axes, keepdims=keep) for end in of))


def _matrix_product(one: Box, other: Box) -> Box:
    row, column = one.low.ndim == 1, other.low.ndim == 1
    first = Box(*(end[None] if row else end for end in one))
    second = Box(*(end[:, None] if column else end for end in other))
    product = _times(Box(*(end[..., None] for end in first)), Box(*(end[..., None, :, :] for end in second)))
    found = _summed(product, (-2,), keep=False)
    if column:
        found = Box(*(end[..., 0] for end in found))
    return Box(*(end[0] if end.ndim == 1 else end[..., 0, :] for end in found)) if row else found


def _gemm(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    one, other, *bias = _there(given)
    one = Box(*(end.T for end in one)) if attributes.get("transA") else one
    other = Box(*(end.T for end in other)) if attributes.get("transB") else other
    found = _times(_matrix_product(one, other), Box.at(attributes.get("alpha", 1.0)))
    return _plus(found, _times(bias[0], Box.at(attributes.get("beta", 1.0)))) if bias else found


def _power(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    of, exponent = _there(given)
    if float(_point(exponent)) != 2.0:
        raise UnsupportedOperatorError("Pow to another power than 2")
    absolute = _absolute(of)
    return Box(absolute.low**2, absolute.high**2)


def _clip(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    of, low, high = (*given, None, None)[:3]
    assert of is not None
    for limit, end in ((low, np.maximum), (high, np.minimum)):
        if limit is not None:
            of = Box(end(of.low, limit.low), end(of.high, limit.high))
    return of


def _where(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    condition, one, other = _there(given)
    either = Box(np.minimum(one.low, other.low), np.maximum(one.high, other.high))
    always, never = condition.low > 0, condition.high <= 0
    return Box(
        *(np.where(always, a, np.where(never, b, c)) for a, b, c in zip(one, other, either, strict=True))
    )


def _axes(given: list[Box | None], attributes: dict[str, Any]) -> tuple[int, ...] | None:
    if len(given) > 1:
        return _whole(given[1])
    return tuple(attributes["axes"]) if "axes" in attributes else None


def _reduced(mean: bool) -> Callable[[list[Box | None], dict[str, Any]], Box]:
    def reduced(given: list[Box | None], attributes: dict[str, Any]) -> Box:
        of, axes = _there(given)[0], _axes(given, attributes)
        total = _summed(of, axes, bool(attributes.get("keepdims", 1)))
        count = of.low.size / max(total.low.size, 1) if mean else 1.0
        return Box(total.low / count, total.high / count)

    return reduced


def _largest(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    of, axes = _there(given)[0], _axes(given, attributes)
    return Box(*(end.max(axis=axes, keepdims=bool(attributes.get("keepdims", 1))) for end in of))


def _split(given: list[Box | None], attributes: dict[str, Any]) -> list[Box]:
    of, axis = _there(given)[0], int(attributes.get("axis", 0))
    if len(given) > 1:
        places: Any = np.cumsum(_whole(given[1]))[:-1]
    else:
        each = -(-of.low.shape[axis] // int(attributes["num_outputs"]))
        places = np.arange(each, of.low.shape[axis], each)
    return [Box(*ends) for ends in zip(*(np.split(end, places, axis=axis) for end in of), strict=True)]


def _expanded(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    axes = _axes(given, attributes)
    assert axes is not None
    return Box(*(np.expand_dims(end, axes) for end in _there(given)[0]))


def _squeezed(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    axes = _axes(given, attributes)
    return Box(*(np.squeeze(end, axes) for end in _there(given)[0]))


def _gathered(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    of, places = _there(given)
    index = _point(places).astype(int)
    return Box(*(np.take(end, index, axis=int(attributes.get("axis", 0))) for end in of))


def _joined(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    parts, axis = _there(given), int(attributes["axis"])
    return Box(*(np.concatenate(ends, axis=axis) for ends in zip(*parts, strict=True)))


def _unknown_truth(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    shape = _there(given)[0].low.shape
    return Box(np.zeros(shape), np.ones(shape))


def _softmax(given: list[Box | None], attributes: dict[str, Any]) -> Box:
    return _unknown_truth(given, attributes)


def _sigmoid(values: Array) -> Array:
    half: Array = 0.5 * (1 + np.tanh(values / 2))
    return half


_RISING: dict[str, Callable[[Array], Array]] = {
    "Asinh": np.arcsinh,
    "Cast": lambda values: values,
    "Exp": np.exp,
    "Identity": lambda values: values,
    "Log": lambda values: np.log(np.maximum(values, 0.0)),
    "Relu": lambda values: np.maximum(values, 0.0),
    "Sigmoid": _sigmoid,
    "Sign": np.sign,
    "Sqrt": lambda values: np.sqrt(np.maximum(values, 0.0)),
    "Tanh": np.tanh,
}
"""Operators on each element that rise with it."""

_OPERATORS: dict[str, Callable[[list[Box | None], dict[str, Any]], Box | list[Box]]] = {
    "Abs": lambda given, _: _absolute(_there(given)[0]),
    "Add": lambda given, _: _plus(*_there(given)),
    "Clip": _clip,
    "Concat": _joined,
    "Constant": lambda _, attributes: Box.at(next(iter(attributes.values()))),
    "Div": lambda given, _: _times(_there(given)[0], _inverse(_there(given)[1])),
    "Gather": _gathered,
    "Gemm": _gemm,
    "IsNaN": _unknown_truth,
    "MatMul": lambda given, _: _matrix_product(*_there(given)),
    "Max": lambda given, _: Box(*(reduce(np.maximum, ends) for ends in zip(*_there(given), strict=True))),
    "Min": lambda given, _: Box(*(reduce(np.minimum, ends) for ends in zip(*_there(given), strict=True))),
    "Mul": lambda given, _: _times(*_there(given)),
    "Neg": lambda given, _: _negative(_there(given)[0]),
    "Not": lambda given, _: Box(1 - _there(given)[0].high, 1 - _there(given)[0].low),
    "Pow": _power,
    "ReduceMax": _largest,
    "ReduceMean": _reduced(mean=True),
    "ReduceSum": _reduced(mean=False),
    "Softmax": _softmax,
    "Split": _split,
    "Squeeze": _squeezed,
    "Sub": lambda given, _: _plus(_there(given)[0], _negative(_there(given)[1])),
    "Transpose": lambda given, a: Box(*(np.transpose(end, a.get("perm")) for end in _there(given)[0])),
    "Unsqueeze": _expanded,
    "Where": _where,
}
"""All others."""
