"""A module of torch as a running estimator calls it, without a file."""

import numpy as np
import torch
from numpy.typing import NDArray

from rl.supervised import tensor32

Array = NDArray[np.float64]


class TorchNetwork:
    """A module of torch on arrays of NumPy, as a running estimator calls it.

    Attributes:
        module: takes and returns tensors, as the exported graph does.
        hidden: units of its recurrent layer.
    """

    def __init__(self, module: torch.nn.Module, hidden: int) -> None:
        self.module = module
        self.hidden = hidden

    @torch.inference_mode()
    def __call__(self, seen: Array, memory: NDArray[np.float32]) -> tuple[Array, NDArray[np.float32]]:
        """Return what the network says, and what it remembers."""
        said, remembered = self.module(tensor32(seen), tensor32(memory))
        return said.numpy().astype(float), remembered.numpy()
