"""Export of a trained module of torch to one ONNX file that carries its own description."""

import json
import logging
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import onnx
import torch

from rl.compiled_code import no_folder_of_compiled_code
from twin.errors import InputError
from twin.estimation.learned.reference import AFTER, REFERENCE, reference_to_dict
from twin.estimation.learned.trained_file import METADATA_KEY, PARAMETERS
from twin.files.atomic import write_whole


def export_module(
    module: torch.nn.Module,
    inputs: Mapping[str, torch.Tensor],
    outputs: Sequence[str],
    free: Mapping[str, Sequence[int]],
    description: Mapping[str, Any],
    path: Path,
    reference: Mapping[str, torch.Tensor] | None = None,
) -> None:
    """Write a module as ONNX, whole or not at all.

    Args:
        module: to write, as it is called with the inputs in their order.
        inputs: an example of each, of any size from 2 on along its free axes.
        outputs: their names.
        free: by input, the axes along which any size may come.
        description: plain values; `agent` says which method the file is of. The file also says how many
            numbers were learned.
        path: the file.
        reference: (steps, batch, ...) inputs whose outputs, as the module itself has them, are kept in the
            file: `endotwin gate` replays them. Inputs that are not among them are states.

    Raises:
        ValueError: torch cannot export the module, or what it exports is not valid.
        OSError: the disk is full or fails.
    """
    with warnings.catch_warnings(), no_folder_of_compiled_code():
        warnings.simplefilter("ignore")  # between torch and its exporter
        try:
            graph = onnx_graph(module.eval(), inputs, outputs, free)
            told = dict(description) | {PARAMETERS: sum(part.numel() for part in module.parameters())}
            if reference is not None:
                told[REFERENCE] = _reference(module, reference, inputs, outputs)
            onnx.helper.set_model_props(graph, {METADATA_KEY: json.dumps(told)})
            onnx.checker.check_model(graph)
        except (RuntimeError, onnx.checker.ValidationError) as error:
            first = str(error).strip().partition("\n")[0]
            raise InputError(f"{path}: torch could not export it: {first:.150}") from error
    write_whole(path, graph.SerializeToString())


def onnx_graph(
    module: torch.nn.Module,
    inputs: Mapping[str, torch.Tensor],
    outputs: Sequence[str],
    free: Mapping[str, Sequence[int]],
) -> onnx.ModelProto:
    """Return a module as ONNX; arguments as of `export_module`."""
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it names operators of packages not used here
    axes = {name: {axis: torch.export.Dim.DYNAMIC for axis in free.get(name, ())} for name in inputs}
    program = torch.onnx.export(
        module,
        tuple(inputs.values()),
        input_names=list(inputs),
        output_names=list(outputs),
        dynamic_shapes=tuple(axes.values()),
        dynamo=True,
        external_data=False,
        verbose=False,
    )
    assert program is not None
    return program.model_proto


def _reference(
    module: torch.nn.Module,
    given: Mapping[str, torch.Tensor],
    inputs: Mapping[str, torch.Tensor],
    outputs: Sequence[str],
) -> dict[str, Any]:
    """Return steps of the module from a state of zeros, as a trained file holds them."""
    steps, batch = next(iter(given.values())).shape[:2]
    memory = {
        name: example.new_zeros(batch, *example.shape[1:])
        for name, example in inputs.items()
        if name not in given
    }
    kept: dict[str, list[Any]] = {name: [] for name in outputs if not name.endswith(AFTER)}
    with torch.no_grad():
        for step in range(steps):
            now = {name: of[step] for name, of in given.items()} | memory
            returned = module(*(now[name] for name in inputs))
            of_step = dict(
                zip(outputs, returned if isinstance(returned, tuple) else (returned,), strict=True)
            )
            for name, values in kept.items():
                values.append(of_step[name].numpy())
            memory = {name: of_step[f"{name}{AFTER}"] for name in memory}
    return reference_to_dict({name: of.numpy() for name, of in given.items()}, kept)
