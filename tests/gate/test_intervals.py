"""Interval arithmetic encloses whatever the graph returns, and no more than it must where it can be exact."""

import numpy as np
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from twin.gate.intervals import Box, UnsupportedOperatorError, enclose


def graph_of(nodes, constants, inputs, outputs):
    return helper.make_graph(
        nodes,
        "graph",
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in inputs.items()],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in outputs],
        [numpy_helper.from_array(np.asarray(value, np.float32), name) for name, value in constants.items()],
    )


def run(graph, **inputs):
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)])
    model.ir_version = 10
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {name: np.asarray(value, np.float32) for name, value in inputs.items()})


def policy(rng, last="Clip"):
    """An observation on a log scale, two layers, and a bounded action: as a policy of RAM is written."""
    nodes = [
        helper.make_node("Sign", ["x"], ["sign"]),
        helper.make_node("Abs", ["x"], ["abs"]),
        helper.make_node("Add", ["abs", "one"], ["plus"]),
        helper.make_node("Log", ["plus"], ["log"]),
        helper.make_node("Mul", ["sign", "log"], ["scaled"]),
        helper.make_node("Gemm", ["scaled", "w1", "b1"], ["h1"], transB=1),
        helper.make_node("Tanh", ["h1"], ["t1"]),
        helper.make_node("MatMul", ["t1", "w2"], ["h2"]),
        helper.make_node("Relu", ["h2"], ["r2"]),
        helper.make_node("Clip", ["r2", "low", "high"], ["out"]),
    ]
    constants = {
        "one": np.float32(1),
        "w1": rng.normal(size=(5, 2)),
        "b1": rng.normal(size=5),
        "w2": rng.normal(size=(5, 3)),
        "low": np.float32(-1),
        "high": np.float32(1),
    }
    if last != "Clip":
        nodes = nodes[:-1]
    out = "out" if last == "Clip" else "r2"
    return graph_of(nodes, constants, {"x": [1, 2]}, [out]), out


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.floats(0.0, 5.0), st.floats(-20, 20))
def test_what_the_graph_returns_is_inside_of_its_enclosure(seed, width, middle):
    rng = np.random.default_rng(seed)
    graph, out = policy(rng, last="Relu")
    low, high = np.full((1, 2), middle - width), np.full((1, 2), middle + width)
    box = enclose(graph, {"x": Box(low, high)})[out]
    for _ in range(20):
        (value,) = run(graph, x=rng.uniform(low, high))
        assert (value >= box.low - 1e-4).all()
        assert (value <= box.high + 1e-4).all()


def test_a_point_is_enclosed_by_itself():
    graph, out = policy(np.random.default_rng(1))
    x = np.array([[0.3, -2.0]])
    box = enclose(graph, {"x": Box.at(x)})[out]
    np.testing.assert_allclose(box.low, run(graph, x=x)[0], atol=1e-6)
    np.testing.assert_array_equal(box.low, box.high)


def test_all_numbers_lead_to_the_bounds_of_the_last_operator_and_no_farther():
    everything = Box(np.full((1, 2), -np.inf), np.full((1, 2), np.inf))
    graph, out = policy(np.random.default_rng(2))
    box = enclose(graph, {"x": everything})[out]
    assert (box.low >= -1).all()
    assert (box.high <= 1).all()
    graph, out = policy(np.random.default_rng(2), last="Relu")
    weights = np.abs(numpy_helper.to_array(next(p for p in graph.initializer if p.name == "w2"))).sum(axis=0)
    box = enclose(graph, {"x": everything})[out]
    assert (box.high <= weights + 1e-6).all()  # a hidden unit is in [-1, 1]


@pytest.mark.parametrize(
    ("operator", "one", "other", "low", "high"),
    [
        ("Mul", (-2, 3), (-5, 4), -15, 12),
        ("Mul", (0, 0), (-np.inf, np.inf), 0, 0),
        ("Div", (1, 2), (2, 4), 0.25, 1),
        ("Div", (-1, 2), (0, 4), -np.inf, np.inf),
        ("Div", (1, 2), (-1, 1), -np.inf, np.inf),
        ("Sub", (0, 1), (0, 1), -1, 1),
        ("Max", (-1, 4), (0, 2), 0, 4),
        ("Min", (-1, 4), (0, 2), -1, 2),
    ],
)
def test_ends_of_simple_operators(operator, one, other, low, high):
    graph = graph_of([helper.make_node(operator, ["a", "b"], ["c"])], {}, {"a": [1], "b": [1]}, ["c"])
    ends = [Box(np.array([box[0]], float), np.array([box[1]], float)) for box in (one, other)]
    box = enclose(graph, {"a": ends[0], "b": ends[1]})["c"]
    assert (box.low[0], box.high[0]) == (low, high)


def test_an_operator_that_is_not_known_is_named():
    graph = graph_of([helper.make_node("Sin", ["a"], ["b"])], {}, {"a": [1]}, ["b"])
    with pytest.raises(UnsupportedOperatorError, match=r"^Sin$"):
        enclose(graph, {"a": Box.at(np.zeros(1))})
