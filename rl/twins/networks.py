"""Small networks of the steps: layers with hyperbolic tangents, and their last layer."""

import torch


def network(inputs: int, hidden: int, outputs: int, layers: int = 2) -> torch.nn.Sequential:
    """Return a network of equal layers with hyperbolic tangents; without layers, it is linear."""
    parts: list[torch.nn.Module] = []
    for _ in range(layers):
        parts += [torch.nn.Linear(inputs, hidden), torch.nn.Tanh()]
        inputs = hidden
    return torch.nn.Sequential(*parts, torch.nn.Linear(inputs, outputs))


def last_layer(layers: torch.nn.Sequential) -> torch.nn.Linear:
    """Return the last layer of a network."""
    layer = layers[-1]
    assert isinstance(layer, torch.nn.Linear)
    return layer
