"""A trained network in one ONNX file that carries its own description, read and run without torch."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError

METADATA_KEY = "endotwin"
"""Key of the description, as JSON, among the metadata of the ONNX file."""
LARGEST = 256 * 2**20
"""Size that no trained file of ours comes near [bytes]."""


@dataclasses.dataclass(frozen=True)
class TrainedFile:
    """An ONNX session and what the file says of itself.

    Attributes:
        session: of ONNX Runtime, on one thread.
        agent: word that it was trained under.
        description: model, sample time and configuration, as plain values.
        path: where it was read from; another process reads it there too.
    """

    session: Any
    agent: str
    description: dict[str, Any]
    path: Path | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to a worker process as a path, as a session cannot."""
        if self.path is None:
            raise TypeError("a network that was not read from a file cannot be sent to another process")
        return read_trained_file, (self.path, self.agent)

    def run(self, **inputs: NDArray[Any]) -> list[NDArray[np.float32]]:
        """Return the outputs of the network for named inputs, which are taken in single precision."""
        feed = {name: np.asarray(values, dtype=np.float32) for name, values in inputs.items()}
        outputs: list[NDArray[np.float32]] = self.session.run(None, feed)
        return outputs


def read_trained_file(path: Path, agent: str | None = None) -> TrainedFile:
    """Read a trained network.

    Args:
        path: the ONNX file.
        agent: that it must be of; any, if not given.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no ONNX file, not one of ours, or of another agent.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFileError(f"no trained file {path}; `endotwin train` writes one")
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path} has {path.stat().st_size} bytes: a trained file has at most {LARGEST}")
    import onnxruntime  # imported when used: a table of methods needs none of it

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what is wrong with a file is told below, in one line
    try:
        content = path.read_bytes()  # from bytes: the file cannot name other files to load
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        description = json.loads(session.get_modelmeta().custom_metadata_map[METADATA_KEY])
        found = description.pop("agent")
        if not isinstance(found, str):
            raise TypeError("the agent is no text")
    except Exception as error:  # onnxruntime raises its own classes for a file that it cannot read
        raise InputError(f"{path} is not a trained file written by `endotwin train`") from error
    if agent is not None and found != agent:
        raise InputError(f"{path} holds the agent {found!r}, not {agent!r}")
    return TrainedFile(session, found, description, path)
