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
from twin.estimation.learned.trained_file import METADATA_KEY
from twin.files.atomic import write_whole


def export_module(
    module: torch.nn.Module,
    inputs: Mapping[str, torch.Tensor],
    outputs: Sequence[str],
    free: Mapping[str, Sequence[int]],
    description: Mapping[str, Any],
    path: Path,
) -> None:
    """Write a module as ONNX, whole or not at all.

    Args:
        module: to write, as it is called with the inputs in their order.
        inputs: an example of each, of any size from 2 on along its free axes.
        outputs: their names.
        free: by input, the axes along which any size may come.
        description: plain values; `agent` says which method the file is of.
        path: the file.

    Raises:
        ValueError: torch cannot export the module, or what it exports is not valid.
        OSError: the disk is full or fails.
    """
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it names operators of packages not used here
    axes = {name: {axis: torch.export.Dim.DYNAMIC for axis in free.get(name, ())} for name in inputs}
    with warnings.catch_warnings(), no_folder_of_compiled_code():
        warnings.simplefilter("ignore")  # between torch and its exporter
        try:
            program = torch.onnx.export(
                module.eval(),
                tuple(inputs.values()),
                input_names=list(inputs),
                output_names=list(outputs),
                dynamic_shapes=tuple(axes.values()),
                dynamo=True,
                external_data=False,
                verbose=False,
            )
            assert program is not None
            graph = program.model_proto
            onnx.helper.set_model_props(graph, {METADATA_KEY: json.dumps(dict(description))})
            onnx.checker.check_model(graph)
        except (RuntimeError, onnx.checker.ValidationError) as error:
            first = str(error).strip().partition("\n")[0]
            raise InputError(f"{path}: torch could not export it: {first:.150}") from error
    write_whole(path, graph.SerializeToString())
