"""Recurrent layers of torch as operators of ONNX; torch's own exporter would fix the number of samples."""

from pathlib import Path
from typing import Any

import torch

from rl.export import export_module


class RecurrentGraph(torch.nn.Module):
    """An LSTM or a GRU layer of torch as the ONNX operator of that name, for any number of samples."""

    def __init__(self, layer: torch.nn.LSTM | torch.nn.GRU):
        """Reorder the weights: ONNX has the gates in another order than torch."""
        super().__init__()
        self.hidden = layer.hidden_size
        self.is_lstm = isinstance(layer, torch.nn.LSTM)
        # torch: input, forget, cell, output; ONNX: input, output, forget, cell. torch: reset, update, new;
        # ONNX: update, reset, new.
        order = (0, 3, 1, 2) if self.is_lstm else (1, 0, 2)
        weights = {name: weight.detach() for name, weight in layer.named_parameters()}

        def gates(name: str) -> torch.Tensor:
            parts = weights[name].chunk(len(order))
            return torch.cat([parts[place] for place in order])[None]

        self.of_input = torch.nn.Buffer(gates("weight_ih_l0"))
        self.of_memory = torch.nn.Buffer(gates("weight_hh_l0"))
        self.bias = torch.nn.Buffer(torch.cat([gates("bias_ih_l0"), gates("bias_hh_l0")], dim=1))

    def forward(self, inputs: torch.Tensor, memory: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the (N, B, hidden) outputs and the (states, B, hidden) memory after them."""
        samples, batch, _ = inputs.shape
        each = (1, batch, self.hidden)
        states = memory.split(1)
        attributes: dict[str, Any]
        attributes = {"hidden_size": self.hidden}
        if not self.is_lstm:
            attributes["linear_before_reset"] = 1
        outputs, *remembered = torch.onnx.ops.symbolic_multi_out(
            "LSTM" if self.is_lstm else "GRU",
            (inputs, self.of_input, self.of_memory, self.bias, None, *states),
            attributes,
            dtypes=[torch.float32] * (1 + len(states)),
            shapes=[(samples, *each), *[each] * len(states)],
            version=14,
        )
        return outputs[:, 0], torch.cat(remembered)


class WholeGraph(torch.nn.Module):
    """A recurrent network with its layer as an operator of ONNX, to be exported.

    Attributes:
        network: with `before`, `layer` and `behind`.
    """

    def __init__(self, network: torch.nn.Module):
        super().__init__()
        self.network = network
        self.layer = RecurrentGraph(network.layer)  # type: ignore[arg-type]

    def forward(self, seen: torch.Tensor, memory: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return what the network returns."""
        outputs, remembered = self.layer(self.network.before(seen), memory)  # type: ignore[operator]
        said: torch.Tensor = self.network.behind(outputs)  # type: ignore[operator]
        return said, remembered


def export_recurrent(
    network: torch.nn.Module, states: int, agent: str, configuration: dict[str, object], path: Path
) -> None:
    """Write a network of (N, B, 2) inputs and (states, B, hidden) memory as a trained file."""
    hidden = int(network.hidden)  # type: ignore[arg-type]
    export_module(
        WholeGraph(network),
        {"seen": torch.zeros(3, 2, 2), "memory": torch.zeros(states, 2, hidden)},
        ["said", "remembered"],
        {"seen": [0, 1], "memory": [1]},
        {"agent": agent, "hidden": hidden, **configuration},
        path,
    )
