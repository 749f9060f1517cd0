"""A trained file changed as damage or a careless hand changes it: a sign flipped, a normaliser taken out."""

from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper


def initializer(model: onnx.ModelProto, name: str) -> np.ndarray:
    return numpy_helper.to_array(next(part for part in model.graph.initializer if part.name == name)).copy()


def with_initializer(model: onnx.ModelProto, name: str, values: np.ndarray) -> onnx.ModelProto:
    changed = onnx.ModelProto()
    changed.CopyFrom(model)
    place = next(number for number, part in enumerate(changed.graph.initializer) if part.name == name)
    kind = initializer(model, name).dtype
    changed.graph.initializer[place].CopyFrom(numpy_helper.from_array(values.astype(kind), name))
    return changed


def with_flipped_sign(source: Path, target: Path, name: str, place: int) -> Path:
    model = onnx.load(source)
    values = initializer(model, name)
    values.flat[place] *= -1
    onnx.save(with_initializer(model, name, values), target)
    return target


def without_operator(source: Path, target: Path, operator: str) -> Path:
    """Leave out every node of an operator with one input: what follows gets that input as it is."""
    model = onnx.load(source)
    replaced = {node.output[0]: node.input[0] for node in model.graph.node if node.op_type == operator}
    assert replaced
    kept = [node for node in model.graph.node if node.op_type != operator]
    for node in kept:
        for number, name in enumerate(node.input):
            while name in replaced:
                name = replaced[name]
            node.input[number] = name
    del model.graph.node[:]
    model.graph.node.extend(kept)
    onnx.save(model, target)
    return target
