"""A recurrent network or a filter's step of torch, and the graph that is exported of it."""

import copy
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from torch_network import TorchNetwork

from rl.recurrent_graph import export_recurrent
from rl.twins.graph import MemoryGraph, TwinsGraph
from rl.twins.sequences import Sequences
from twin.estimation.learned.recurrent import OnnxNetwork
from twin.estimation.learned.step_network import OF_SAMPLE
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file


def assert_exported_alike(network: torch.nn.Module, states: int) -> None:
    """Both say and remember the same, for records of several lengths and sizes, one after the other."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "network.onnx"
        export_recurrent(network, states, "toy", {}, path)
        exported = OnnxNetwork(read_trained_file(path))
        trained = TorchNetwork(network, network.hidden)
        rng = np.random.default_rng(0)
        for samples, batch in ((1, 1), (7, 3), (40, 2)):
            memory = np.zeros((states, batch, network.hidden), np.float32)
            for _ in range(2):
                seen = rng.standard_normal((samples, batch, 2))
                said, remembered = exported(seen, memory)
                expected, memory = trained(seen, memory)
                np.testing.assert_allclose(said, expected, atol=1e-5)
                np.testing.assert_allclose(remembered, memory, atol=1e-5)


def filtered_by_both(
    graph: TwinsGraph | MemoryGraph,
    file: TrainedFile,
    names: Sequence[str],
    drawn: Sequences,
    samples: int,
    is_missing: Callable[[int], bool],
    precision: torch.dtype = torch.float64,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield what the exported graph and torch say of each sample, (2, B) estimate and half of the interval.

    Both begin at a state of zeros, and each goes on from its own.

    Args:
        graph: the trained step with plain arrays in and out.
        file: the exported graph.
        names: of what it predicts by, then of its state.
        drawn: sequences; behind their end they begin anew.
        samples: how many, in all.
        is_missing: whether the first filter has no measurement at a sample.
        precision: of torch.
    """
    of_torch = [torch.zeros_like(of, dtype=precision) for of in graph.step.start(drawn.variance)]
    graph = copy.deepcopy(graph).to(precision)
    of_onnx = [of.numpy() for of in of_torch]
    predicted_by, state = names[: len(drawn.inputs)], names[len(drawn.inputs) :]
    for k in range(samples):
        place = k % len(drawn.measurement_deg)
        measurement = drawn.measurement_deg[place].clone()
        if is_missing(k):
            measurement[0] = torch.nan
        values = (
            *(of[place] for of in drawn.inputs),
            measurement,
            drawn.variance,
            drawn.sample_time,
            torch.ones(2),
        )
        values = tuple(of.to(precision) for of in values)
        with torch.no_grad():
            bend, half_width, *of_torch = graph(*values, *of_torch)
        told = dict(zip((*predicted_by, *OF_SAMPLE), (of.numpy() for of in values), strict=True))
        found = file.run(**told, **dict(zip(state, of_onnx, strict=True)))
        of_onnx = found[2:]
        yield np.array(found[:2]), torch.stack([bend, half_width]).numpy()
