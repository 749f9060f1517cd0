"""A recurrent network that filters, read from its trained file."""

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.trained_file import TrainedFile, check_network, read_trained_file
from twin.files.shown import shown
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
BATCH = 2  # records that a network is tried on when it is read
Array32 = NDArray[np.float32]


class RecurrentNetwork(Protocol):
    """A recurrent network on arrays: what it sees and remembers in, what it says and remembers out."""

    @property
    def hidden(self) -> int:
        """Units of the recurrent layer."""

    def __call__(self, seen: Array, memory: Array32) -> tuple[Array, Array32]:
        """Return what the network says, and what it remembers.

        Args:
            seen: what it sees; taken in single precision.
            memory: (states, B, hidden), all zero before the first sample.
        """


class OnnxNetwork:
    """The network of a trained file, run by ONNX Runtime."""

    def __init__(self, file: TrainedFile) -> None:
        """Take the session over.

        Raises:
            ValueError: the file states no size of the network.
        """
        self.file = file
        hidden = file.description.get("hidden")
        if not isinstance(hidden, int) or hidden < 1:
            raise InputError(f"hidden = {shown(hidden)}: must be a positive whole number")
        self.hidden = hidden

    def __call__(self, seen: Array, memory: Array32) -> tuple[Array, Array32]:
        """Return what the network says, and what it remembers."""
        said, memory = self.file.run(seen=seen, memory=memory)
        return said.astype(float), memory


def read_network(
    path: Path, agent: str, *, states: int, seen: tuple[int, ...], said: tuple[int, ...]
) -> tuple[OnnxNetwork, HysteresisModel, float]:
    """Return the network, the model of hysteresis and the sample time [s] of a trained file.

    Args:
        path: of the file.
        agent: that it must be of.
        states: arrays of memory.
        seen: shape of what it sees of two records.
        said: shape of what it says of them.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, of another agent, or takes or returns something else.
    """
    file = read_trained_file(path, agent)
    try:
        network = OnnxNetwork(file)
        memory = (states, BATCH, network.hidden)
        check_network(file, {"seen": seen, "memory": memory}, {"said": said, "remembered": memory})
        beside = ActiveModel.from_dict(file.description.get("active_model"))
        return network, beside.model, beside.sample_time
    except ValueError as error:
        raise InputError(
            f"{path} is no network of the agent {agent!r} that training wrote: {error}"
        ) from error
