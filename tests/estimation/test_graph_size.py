"""Shapes of the arrays of a graph before it is run, against ONNX's own inference; graphs that grow."""

import math
import time

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from twin.errors import InputError
from twin.estimation.learned.graph_check import check_graph
from twin.estimation.learned.graph_size import BATCH, MOST_ELEMENTS


def graph(nodes, constants) -> bytes:
    """An ONNX file with an input x of any length, and an output y."""
    made = helper.make_graph(
        nodes,
        "g",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n"])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, None)],
        [numpy_helper.from_array(np.asarray(of), name) for name, of in constants.items()],
    )
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 20)], ir_version=10)
    return model.SerializeToString()


def shapes_by_onnx(content: bytes) -> dict[str, tuple[int, ...]]:
    model = onnx.load_from_string(content)
    for part in model.graph.input:
        for axis in part.type.tensor_type.shape.dim:
            if axis.dim_param:
                axis.Clear()
                axis.dim_value = BATCH
    del model.graph.output[:]
    found = onnx.shape_inference.infer_shapes(model, data_prop=True, strict_mode=True).graph.value_info
    return {of.name: tuple(axis.dim_value for axis in of.type.tensor_type.shape.dim) for of in found}


def test_shapes_of_trained_files_are_those_of_onnx(ram_policy, twins_policy):
    for path in (ram_policy, twins_policy):
        found, expected = (of(path.read_bytes()) for of in (check_graph, shapes_by_onnx))
        assert expected
        assert {name: found[name] for name in expected} == expected


LENGTHS = st.sampled_from([1, 1, 2, 3, 5])
NODES = [
    ("Add", {}, 2),
    ("MatMul", {}, 2),
    ("Gemm", {"transB": 1}, 2),
    ("Gemm", {"transA": 1}, 2),
    ("Concat", {"axis": 1}, 2),
    ("Concat", {"axis": -1}, 2),
    ("ReduceSum", {"keepdims": 0}, 1),
    ("ReduceMax", {"keepdims": 1}, 1),
    ("Transpose", {"perm": [1, 0]}, 1),
    ("Transpose", {}, 1),
    ("Softmax", {}, 1),
    ("Gather", {"axis": 1}, 1),
    ("Unsqueeze", {}, 1),
    ("Squeeze", {}, 1),
    ("Split", {"axis": 1}, 1),
    ("Split", {"axis": 0, "num_outputs": 2}, 1),
]
SECOND = {"ReduceSum": [1], "Gather": [[0, 0], [0, 0]], "Unsqueeze": [0, 3], "Squeeze": [0], "Split": [1, 2]}


@given(data=st.data())
@settings(max_examples=150)
def test_shapes_of_any_graph_are_those_of_onnx_where_its_arrays_fit(data):
    constants = {f"c{k}": np.zeros(data.draw(st.tuples(LENGTHS, LENGTHS)), np.float32) for k in range(3)}
    constants |= {name.lower(): np.array(of, np.int64) for name, of in SECOND.items()}
    nodes, known = [], ["x", "c0", "c1", "c2"]
    for number in range(data.draw(st.integers(1, 4))):
        operator, attributes, count = data.draw(st.sampled_from(NODES))
        given_names = [data.draw(st.sampled_from(known)) for _ in range(count)]
        if operator in SECOND and "num_outputs" not in attributes:
            given_names.append(operator.lower())
        outputs = [f"v{number}", f"w{number}"][: 1 + (operator == "Split")]
        nodes.append(helper.make_node(operator, given_names, outputs, **attributes))
        known += outputs
    nodes.append(helper.make_node("Tanh", [known[-1]], ["y"]))
    content = graph(nodes, constants)
    try:
        expected = shapes_by_onnx(content)
    except onnx.shape_inference.InferenceError:
        return  # what does not fit together cannot be run either
    found = check_graph(content)
    assert {name: found[name] for name in expected} == expected


def chain(operator: str, first: str, second: str, count: int, **attributes):
    """Operators that are each given what the one before gave, twice."""
    nodes = [helper.make_node(operator, [first, second], ["v0"], **attributes)]
    return nodes + [
        helper.make_node(operator, [f"v{k}", f"v{k}"], [f"v{k + 1}"], **attributes) for k in range(count)
    ]


COLUMN, ROW = np.zeros((8192, 1, 1), np.float32), np.zeros((1, 8192, 1), np.float32)
SQUARE, LONG = np.zeros((1024, 1024), np.float32), np.zeros(8192, np.float32)
GROWING = {
    "constants that are broadcast": (chain("Add", "a", "b", 0), {"a": COLUMN, "b": ROW}, "elements"),
    "a chain of products": (chain("MatMul", "a", "a", 200), {"a": SQUARE}, "multiplications"),
    "doubled again and again": (
        chain("Concat", "a", "a", 3, axis=0),
        {"a": np.zeros((8192, 64), np.float32)},
        "elements",
    ),
    "joined 2,000 times": (
        [helper.make_node("Concat", ["a"] * 2000, ["v0"], axis=0)],
        {"a": LONG},
        "elements",
    ),
    "gathered": (
        [helper.make_node("Gather", ["a", "i"], ["v0"], axis=0)],
        {"a": np.zeros((1, 8192), np.float32), "i": np.zeros((4, 8192), np.int64)},
        "elements",
    ),
    "arrays that do not fit": (chain("Add", "a", "b", 0), {"a": np.zeros(3), "b": np.zeros(5)}, "do not fit"),
    "an operator out of order": (chain("Add", "a", "later", 0), {"a": LONG}, "needs 'later'"),
}


@pytest.mark.parametrize("name", GROWING)
def test_a_graph_that_grows_is_refused_before_it_is_run(name):
    nodes, constants, fault = GROWING[name]
    last = nodes[-1].output[0]
    begin = time.process_time()
    with pytest.raises(InputError, match=fault):
        check_graph(graph([*nodes, helper.make_node("Tanh", [last], ["y"])], constants))
    assert time.process_time() - begin < 2.0


def test_a_constant_inside_of_the_graph_counts_as_well():
    value = numpy_helper.from_array(COLUMN, "value")
    nodes = [helper.make_node("Constant", [], ["a"], value=value), *chain("Add", "a", "b", 0)]
    with pytest.raises(InputError, match="elements"):
        check_graph(graph([*nodes, helper.make_node("Tanh", ["v0"], ["y"])], {"b": ROW}))


def test_the_limit_counts_all_arrays_together():
    side = math.isqrt(MOST_ELEMENTS // 4)
    constant = {"a": np.zeros((side, side), np.float32)}
    few, many = (
        graph([*chain("Add", "a", "a", count), helper.make_node("Tanh", [f"v{count}"], ["y"])], constant)
        for count in (1, 6)
    )
    assert check_graph(few)["y"] == (side, side)
    with pytest.raises(InputError, match="elements"):
        check_graph(many)
