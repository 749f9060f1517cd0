"""Steps that are trained on twins, exported by TorchScript: forty times faster than by the product.

They have hundreds of operations. Most tests that train ask nothing of the graph but that it does what was
trained. Those of the graphs themselves take the product's exporter (the fixture `own_exporter`).
"""

import io
import logging
from collections.abc import Mapping, Sequence

import onnx
import onnx_ir
import pytest
import torch
from onnx_ir.passes.common import LiftConstantsToInitializersPass
from onnxscript import optimizer

import rl.export

OWN = rl.export.onnx_graph


def traced(
    module: torch.nn.Module,
    inputs: Mapping[str, torch.Tensor],
    outputs: Sequence[str],
    free: Mapping[str, Sequence[int]],
) -> onnx.ModelProto:
    """Return a module as ONNX; arguments as of `rl.export.onnx_graph`."""
    if type(module).__module__ != "rl.twins.graph":  # a small one
        return OWN(module, inputs, outputs, free)
    written = io.BytesIO()
    torch.onnx.export(
        module,
        tuple(inputs.values()),
        written,
        input_names=list(inputs),
        output_names=list(outputs),
        dynamic_axes={name: {axis: f"{name}_{axis}" for axis in axes} for name, axes in free.items()},
        opset_version=18,
        dynamo=False,
    )
    model = onnx_ir.from_proto(onnx.load_from_string(written.getvalue()))
    logging.getLogger("onnxscript").setLevel(logging.ERROR)  # it names what it leaves as it is
    optimizer.fold_constants(model)  # without the search for patterns, which takes four seconds
    optimizer.remove_unused_nodes(model)
    LiftConstantsToInitializersPass(lift_all_constants=True, size_limit=0)(model)
    return onnx_ir.to_proto(model)


def take(patch: pytest.MonkeyPatch) -> None:
    """Export by tracing."""
    patch.setattr(rl.export, "onnx_graph", traced)


def leave(patch: pytest.MonkeyPatch) -> None:
    """Export as the product does."""
    patch.setattr(rl.export, "onnx_graph", OWN)
