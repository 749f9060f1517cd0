"""A recurrent network of torch and the graph that is exported of it."""

import tempfile
from pathlib import Path

import numpy as np
import torch
from torch_network import TorchNetwork

from rl.recurrent_graph import export_recurrent
from twin.estimation.learned.recurrent import OnnxNetwork
from twin.estimation.learned.trained_file import read_trained_file


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
