"""A trained network in one ONNX file that carries its own description, read and run without torch."""

import dataclasses
import functools
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError
from twin.estimation.learned.graph_check import check_graph
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.json_text import parse_json_object
from twin.files.shown import cut, shown

METADATA_KEY = "endotwin"  # key of the description, as JSON, among the metadata of the ONNX file
PARAMETERS = "parameters"  # key of the number of learned parameters in the description
LARGEST = 32 * MEBIBYTE  # size that no trained file of ours comes near [bytes]
MOST_METADATA = MEBIBYTE
PRECISIONS: dict[str, type[np.floating[Any]]] = {"tensor(float)": np.float32, "tensor(double)": np.float64}
"""Types of numbers that a network may compute with, by ONNX Runtime's names of them."""


@dataclasses.dataclass(frozen=True)
class TrainedFile:
    """An ONNX session and the description in its file."""

    session: Any  # of ONNX Runtime, on one thread
    agent: str  # word that it was trained under
    description: dict[str, Any]  # model, sample time and configuration, as plain values
    path: Path  # where it was read from; another process reads it there too
    parameters: int | None  # how many numbers were learned, where the file states it

    def __reduce__(self) -> tuple[Any, ...]:
        return read_trained_file, (self.path, self.agent)

    @functools.cached_property
    def precision(self) -> type[np.floating[Any]]:
        """Type of the numbers that the network computes with."""
        return PRECISIONS.get(self.session.get_inputs()[0].type, np.float32)

    def run(self, **inputs: NDArray[Any]) -> list[NDArray[Any]]:
        """Return the outputs of the network for named inputs, which are taken in its own precision."""
        feed = {name: np.asarray(values, dtype=self.precision) for name, values in inputs.items()}
        outputs: list[NDArray[Any]] = self.session.run(None, feed)
        return outputs


class BoundFile:
    """A trained network for one filter on its own arrays `inputs`, by name, to be filled before a run."""

    def __init__(self, file: TrainedFile):
        self._session, self._binding = file.session, file.session.io_binding()
        self.inputs, self._outputs = (
            {
                part.name: np.zeros([n if isinstance(n, int) else 1 for n in part.shape], file.precision)
                for part in parts
            }
            for parts in (file.session.get_inputs(), file.session.get_outputs())
        )
        for arrays, bind in (
            (self.inputs, self._binding.bind_input),
            (self._outputs, self._binding.bind_output),
        ):
            for name, array in arrays.items():
                bind(name, "cpu", 0, file.precision, array.shape, array.ctypes.data)

    def run(self) -> list[NDArray[Any]]:
        """Return copies of the outputs for what the inputs hold."""
        self._session.run_with_iobinding(self._binding)
        return [array.copy() for array in self._outputs.values()]


def read_trained_file(path: Path, agent: str | None = None, trainer: str = "`endotwin train`") -> TrainedFile:
    """Read a trained network."""
    path = Path(path)
    try:
        content = read_limited(path, LARGEST)
    except MissingFileError as error:
        raise MissingFileError(f"no trained file {path}; {trainer} writes one") from error
    # Else newer versions report their use to Microsoft, and leave a file that names the machine.
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
    # Imported when used: a table of methods needs none of them.
    import onnxruntime

    from twin.files.json_text import validated
    from twin.files.trained_schema import TrainedDescription

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what is wrong with a file is stated below, in one line
    try:
        check_graph(content)
        # From bytes: the file cannot name other files to load.
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        values = parse_json_object(session.get_modelmeta().custom_metadata_map[METADATA_KEY], MOST_METADATA)
        known = validated(TrainedDescription, values)
    except Exception as error:  # onnxruntime raises its own classes for a file that it cannot read
        reason = f": {cut(error)}" if isinstance(error, InputError) else ""
        raise InputError(f"{path} is not a trained file written by {trainer}{reason}") from error
    if agent is not None and known.agent != agent:
        raise InputError(f"{path} holds the agent {shown(known.agent)}, not {agent!r}")
    description = {name: value for name, value in values.items() if name != "agent"}
    return TrainedFile(session, known.agent, description, path, known.parameters)


def check_network(
    file: TrainedFile,
    inputs: Mapping[str, tuple[int, ...]],
    outputs: Mapping[str, tuple[int, ...]],
    positive: Collection[str] = (),
    precisions: Collection[str] = ("tensor(float)",),
) -> None:
    """Run a network once on zeros, and check what it takes and returns."""
    types = {part.type for part in file.session.get_inputs()}
    for what, wanted, there in (
        ("inputs", inputs, file.session.get_inputs()),
        ("outputs", outputs, file.session.get_outputs()),
    ):
        found = {part.name: part.type for part in there}
        if found not in [dict.fromkeys(wanted, kind) for kind in precisions if kind in types]:
            raise InputError(
                f"its {what} are {shown(found)}, not {', '.join(wanted)} of {' or '.join(precisions)}"
            )
    try:
        returned = file.run(
            **{name: np.full(shape, float(name in positive)) for name, shape in inputs.items()}
        )
    except Exception as error:  # onnxruntime's own classes, for arrays that do not fit together
        raise InputError("it cannot be run on arrays of the shapes that its estimator has") from error
    for (name, shape), values in zip(outputs.items(), returned, strict=True):
        if values.shape != shape:
            raise InputError(f"its output {name} has the shape {values.shape}, not {shape}")
        if not np.isfinite(values).all():
            raise InputError(f"its output {name} is not finite where it is given nothing but zeros, or ones")
