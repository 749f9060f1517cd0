"""A trained network computes in the precision that its file says, the same throughout."""

import json

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from twin.errors import InputError
from twin.estimation.learned.trained_file import METADATA_KEY, PRECISIONS, check_network, read_trained_file

SINGLE, DOUBLE = TensorProto.FLOAT, TensorProto.DOUBLE


@pytest.fixture
def square_root(tmp_path):
    """Write a file whose graph takes the root of its one input, of any precision."""

    def write(taken, given):
        ends = [helper.make_tensor_value_info(name, of, [2]) for name, of in (("x", taken), ("y", given))]
        nodes = [
            helper.make_node("Sqrt", ["x"], ["root"]),
            helper.make_node("Cast", ["root"], ["y"], to=given),
        ]
        graph = helper.make_graph(nodes, "graph", ends[:1], ends[1:])
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
        helper.set_model_props(model, {METADATA_KEY: json.dumps({"agent": "toy"})})
        onnx.save(model, tmp_path / "policy.onnx")
        return read_trained_file(tmp_path / "policy.onnx")

    return write


@pytest.mark.parametrize(("number", "kind"), [(SINGLE, np.float32), (DOUBLE, np.float64)])
def test_a_network_is_run_in_its_own_precision(square_root, number, kind):
    file = square_root(number, number)
    (found,) = file.run(x=[2.0, 3.0])
    assert found.dtype == kind
    np.testing.assert_array_equal(found, np.sqrt(np.array([2.0, 3.0], kind)))
    check_network(file, {"x": (2,)}, {"y": (2,)}, precisions=PRECISIONS)


def test_another_precision_than_is_asked_for_is_refused(square_root):
    with pytest.raises(InputError, match=r"^its inputs are .*double.*, not x of tensor\(float\)$"):
        check_network(square_root(DOUBLE, DOUBLE), {"x": (2,)}, {"y": (2,)})


def test_two_precisions_in_one_file_are_refused(square_root):
    with pytest.raises(InputError, match=r"^its outputs are .*double.*, not y of "):
        check_network(square_root(SINGLE, DOUBLE), {"x": (2,)}, {"y": (2,)}, precisions=PRECISIONS)
