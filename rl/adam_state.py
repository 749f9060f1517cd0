"""Weights of a network and moments of its Adam by name: what a checkpoint keeps of a training."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray


def begin_moments(network: torch.nn.Module, optimiser: torch.optim.Optimizer) -> None:
    """Give Adam the moments that it makes only at its first step."""
    for parameter in network.parameters():
        optimiser.state[parameter] = {
            "step": torch.tensor(0.0),
            "exp_avg": torch.zeros_like(parameter),
            "exp_avg_sq": torch.zeros_like(parameter),
        }


def adam_state(network: torch.nn.Module, optimiser: torch.optim.Optimizer) -> dict[str, torch.Tensor]:
    """Return the weights and the moments of Adam by name; they share memory with the training."""
    tensors: dict[str, Any] = {}
    for name, parameter in network.named_parameters():
        tensors[f"weight {name}"] = parameter.detach()
        for moment, values in optimiser.state.get(parameter, {}).items():
            tensors[f"{moment} {name}"] = values.detach()
    return tensors


def fits(saved: Mapping[str, NDArray[np.float64]], expected: Mapping[str, torch.Tensor]) -> bool:
    """Return whether arrays that were read hold all of some tensors, in their shapes."""
    return all(name in saved and saved[name].shape == tuple(of.shape) for name, of in expected.items())


def set_tensors(expected: Mapping[str, torch.Tensor], saved: Mapping[str, NDArray[np.float64]]) -> None:
    """Give tensors the numbers that were read for them."""
    with torch.no_grad():
        for name, tensor in expected.items():
            tensor.copy_(torch.as_tensor(saved[name]))
