"""Export of a trained module of torch to one ONNX file that carries its own description."""

import copy
import inspect
import json
import logging
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import onnx
import torch

from twin.errors import InputError
from twin.estimation.learned.reference import ESTIMATE, PREVIOUS, REFERENCE, after, reference_to_dict
from twin.estimation.learned.step import ALL_PARTS, PARTS
from twin.estimation.learned.trained_file import METADATA_KEY, PARAMETERS
from twin.files.atomic import write_whole

_REFERENCE_STEPS = 8  # that the trained step itself computes, and the file contains
_BATCH = 3  # of the example that the export traces; any number may come

Tensor = torch.Tensor


def export_step(
    graph: torch.nn.Module,
    inputs: Mapping[str, tuple[int, ...]],
    state: Mapping[str, tuple[int, ...]],
    description: Mapping[str, Any],
    path: Path,
    outputs: Sequence[str] = ("bend_deg",),
) -> None:
    """Write one sample of a filter as ONNX in double precision, with reference steps.

    A filter adds up the roundings of its covariance: in single precision the graph would drift away from the
    step.
    """
    graph = copy.deepcopy(graph).double()
    shapes = {**inputs, **state}
    # Separate tensors: the export would merge one that is given twice into a single input.
    example = {name: torch.full((_BATCH, *shape), 0.5, dtype=torch.float64) for name, shape in shapes.items()}
    if PARTS in inputs:
        example[PARTS] = torch.tensor(ALL_PARTS, dtype=torch.float64)
    free = {name: [0] for name in shapes if name != PARTS}
    names = [*outputs, *(after(name) for name in state if name != PREVIOUS)]
    export_module(graph, example, names, free, description, path, _reference_inputs(inputs))


def _reference_inputs(inputs: Mapping[str, tuple[int, ...]]) -> dict[str, Tensor]:
    rng = torch.Generator().manual_seed(0)  # of its own: what is drawn for a training stays as it is
    steps = _REFERENCE_STEPS, _BATCH
    given = {
        name: torch.randn(*steps, *shape, generator=rng, dtype=torch.float64)
        for name, shape in inputs.items()
        if name != PARTS
    }
    for name in given.keys() & {"way_mm", "keep"}:
        given[name] = torch.sigmoid(given[name])
    given["measurement_deg"][1, 0] = torch.nan
    if "reference_deg" in given:
        given["reference_deg"] = given["measurement_deg"].clone()
    if "variance" in given:
        given["variance"] = torch.exp(given["variance"])
    if "sample_time" in given:
        given["sample_time"] = torch.full_like(given["sample_time"], 0.1)
    if PARTS in inputs:
        given[PARTS] = torch.tensor(ALL_PARTS, dtype=torch.float64).repeat(_REFERENCE_STEPS, 1)
    return {name: given[name] for name in inputs}


def export_module(
    module: torch.nn.Module,
    inputs: Mapping[str, Tensor],
    outputs: Sequence[str],
    free: Mapping[str, Sequence[int]],
    description: Mapping[str, Any],
    path: Path,
    reference: Mapping[str, Tensor] | None = None,
) -> None:
    """Write a module as ONNX, complete or not at all.

    Args:
        module: to write, as it is called with the inputs in their order.
        inputs: an example of each, of any size from 2 on along its free axes.
        outputs: their names.
        free: by input, the axes along which any size may come.
        description: plain values; `agent` is the word that it was trained under. The file also contains how
            many numbers were learned.
        path: the file.
        reference: (steps, batch, ...) inputs whose outputs, as the module itself computes them, are kept in
            the file: `endotwin gate` replays them. Inputs that are not among them are states.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # between torch and its exporter
        try:
            graph = onnx_graph(module.eval(), inputs, outputs, free)
            contents = dict(description) | {PARAMETERS: sum(part.numel() for part in module.parameters())}
            if reference is not None:
                contents[REFERENCE] = _reference(module, reference, inputs, outputs)
            onnx.helper.set_model_props(graph, {METADATA_KEY: json.dumps(contents)})
            onnx.checker.check_model(graph)
        except (RuntimeError, onnx.checker.ValidationError) as error:
            first = str(error).strip().partition("\n")[0]
            raise InputError(f"{path}: torch could not export it: {first:.150}") from error
    write_whole(path, graph.SerializeToString())


def onnx_graph(
    module: torch.nn.Module,
    inputs: Mapping[str, Tensor],
    outputs: Sequence[str],
    free: Mapping[str, Sequence[int]],
) -> onnx.ModelProto:
    """Return a module as ONNX; arguments as in `export_module`."""
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it names operators of packages not used here
    axes = tuple({axis: torch.export.Dim.DYNAMIC for axis in free.get(name, ())} for name in inputs)
    takes_any = any(
        part.kind is part.VAR_POSITIONAL for part in inspect.signature(module.forward).parameters.values()
    )
    program = torch.onnx.export(
        module,
        tuple(inputs.values()),
        input_names=list(inputs),
        output_names=list(outputs),
        dynamic_shapes=(axes,) if takes_any else axes,
        dynamo=True,
        external_data=False,
        verbose=False,
    )
    assert program is not None
    for value in (value for node in program.model.graph for value in node.outputs):
        if value.name in inputs:  # named after its operator
            value.name = f"{value.name}_inside"
    return program.model_proto


def _reference(
    module: torch.nn.Module,
    given: Mapping[str, Tensor],
    inputs: Mapping[str, Tensor],
    outputs: Sequence[str],
) -> dict[str, Any]:
    steps, batch = next(iter(given.values())).shape[:2]
    memory = {
        name: example.new_zeros(batch, *example.shape[1:])
        for name, example in inputs.items()
        if name not in given
    }
    states = {after(name) for name in memory} - {ESTIMATE}
    kept: dict[str, list[Any]] = {name: [] for name in outputs if name not in states}
    with torch.no_grad():
        for step in range(steps):
            now = {name: of[step] for name, of in given.items()} | memory
            returned = module(*(now[name] for name in inputs))
            of_step = dict(
                zip(outputs, returned if isinstance(returned, tuple) else (returned,), strict=True)
            )
            for name, values in kept.items():
                values.append(of_step[name].numpy())
            memory = {name: of_step[after(name)] for name in memory}
    return reference_to_dict({name: of.numpy() for name, of in given.items()}, kept)
