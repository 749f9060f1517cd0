"""A recurrent network that filters, read from its trained file."""

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.hysteresis import HysteresisModel, model_from_dict

Array = NDArray[np.float64]
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
            raise InputError(f"hidden = {hidden!r}: must be a positive whole number")
        self.hidden = hidden

    def __call__(self, seen: Array, memory: Array32) -> tuple[Array, Array32]:
        """Return what the network says, and what it remembers."""
        said, memory = self.file.run(seen=seen, memory=memory)
        return said.astype(float), memory


def read_network(path: Path, agent: str) -> tuple[OnnxNetwork, HysteresisModel, float]:
    """Return the network, the model of hysteresis and the sample time [s] of a trained file.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, or of another agent.
    """
    file = read_trained_file(path, agent)
    try:
        outputs = [output.name for output in file.session.get_outputs()]
        if outputs != ["said", "remembered"]:
            raise InputError(f"its outputs are {outputs}")
        model = model_from_dict(file.description["active_model"]["model"])
        sample_time = float(file.description["active_model"]["sample_time"])
        return OnnxNetwork(file), model, sample_time
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no network of the agent {agent!r} that training wrote") from error
