"""The gain of a step's graph, read while it runs: what multiplies the innovation."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.learned.step_network import StepNetwork
from twin.estimation.learned.trained_file import LARGEST, PRECISIONS
from twin.files.bounded import read_limited


def _made_by(graph: Any, operator: str, among: set[str] | None = None) -> list[str]:
    """Return what an operator makes, of some inputs."""
    return [
        node.output[0]
        for node in graph.node
        if node.op_type == operator and (among is None or among & set(node.input))
    ]


def sigmoid_gains(graph: Any) -> list[str]:
    """Return the names of gains in a step's graph: sigmoid(log of a ratio + what the policy says)."""
    logits = _made_by(graph, "Add", set(_made_by(graph, "Log")))
    return _made_by(graph, "Sigmoid", set(logits))


def gain_tensors(graph: Any) -> list[str]:
    """Return the name of the gain that multiplies the innovation, behind all that lessens it, if any."""
    gates = sigmoid_gains(graph)
    # Of the products of the gain the first lessens it; where none does, the gain meets the innovation itself.
    products = [name for name in _made_by(graph, "Mul", set(gates)) if not _meets_innovation(graph, name)]
    return (products or gates)[:1]


def _meets_innovation(graph: Any, name: str) -> bool:
    """Return whether a product has a difference, as the innovation is one, among its factors."""
    differences = set(_made_by(graph, "Sub"))
    (node,) = (node for node in graph.node if name in node.output)
    return bool(differences & set(node.input))


class Gains:
    """A trained file whose gain is read while it runs: what the sigmoid of a step's graph becomes.

    Attributes:
        range: least and greatest gain so far.
    """

    def __init__(self, content: bytes):
        import onnx
        import onnxruntime

        model = onnx.load_model_from_string(content)
        self.outputs = len(model.graph.output)
        found = gain_tensors(model.graph)
        number = model.graph.input[0].type.tensor_type.elem_type
        self.there = bool(found)
        model.graph.output.extend(onnx.helper.make_tensor_value_info(name, number, None) for name in found)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self.session = onnxruntime.InferenceSession(
            model.SerializeToString(), options, providers=["CPUExecutionProvider"]
        )
        self.precision = PRECISIONS[self.session.get_inputs()[0].type]
        self.range = (np.inf, -np.inf)

    def run(self, **inputs: NDArray[Any]) -> list[NDArray[Any]]:
        """Return the outputs of the network, as `TrainedFile.run` does."""
        feed = {name: np.asarray(values, dtype=self.precision) for name, values in inputs.items()}
        found = self.session.run(None, feed)
        for gain in found[self.outputs :]:
            self.range = (min(self.range[0], float(gain.min())), max(self.range[1], float(gain.max())))
        outputs: list[NDArray[Any]] = found[: self.outputs]
        return outputs


def watched(path: Path, estimator: Any) -> tuple[Any, Gains | None]:
    """Return an estimator whose gain is read, where it is a step's graph and can be opened, or itself."""
    network = getattr(estimator, "network", None)
    if not isinstance(network, StepNetwork):
        return estimator, None
    try:
        gains = Gains(read_limited(path, LARGEST))
    except ModuleNotFoundError:
        return estimator, None
    if not gains.there:
        return estimator, None
    file: Any = gains
    return dataclasses.replace(estimator, network=dataclasses.replace(network, file=file)), gains
