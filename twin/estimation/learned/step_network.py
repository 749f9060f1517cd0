"""A trained graph that is one whole sample of a filter: inputs and a state in, an estimate and a state out.

A state that is all zero stands for the one before anything is measured.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.learned.scale import LEAST_VARIANCE
from twin.estimation.learned.trained_file import PRECISIONS, TrainedFile, check_network
from twin.files.shown import shown

Array = NDArray[np.float64]
Memory = tuple[NDArray[Any], ...]
"""Arrays of the state of B filters, (B, ...) each."""

SAMPLE_TIME = 0.1  # the paper's [s]
UNKNOWN_DEG = 180.0  # half of the interval before anything is measured [deg]
OF_SAMPLE = ("measurement_deg", "variance", "sample_time", "parts")
"""Inputs of every such graph, behind those that it predicts by."""
OUTPUTS = ("bend_deg", "half_width_deg")
ALL_PARTS = (1.0, 1.0)
"""Parts of the graph that act, 1 or 0: the policy, and what is said of the noise."""
_BATCH = 2  # filters that a graph is tried on when it is read
_LARGEST_STATE = 4096


@dataclasses.dataclass(frozen=True)
class StepNetwork:
    """A graph and the shapes of its state.

    Attributes:
        file: the trained file.
        state: shape of each array of the state of one filter, by name.
    """

    file: TrainedFile
    state: Mapping[str, tuple[int, ...]]

    def start(self, batch: int) -> Memory:
        """Return the state before anything is measured."""
        return tuple(np.zeros((batch, *shape), self.file.precision) for shape in self.state.values())

    def step(
        self,
        memory: Memory,
        measurement_deg: Array,
        variance: ArrayLike,
        sample_time: float,
        parts: tuple[float, float] = ALL_PARTS,
        **predicted_by: NDArray[Any],
    ) -> tuple[Array, Array, Memory]:
        """Return estimate (B,), half of its 95 % interval (B,) [deg] and the state, one sample later.

        Args:
            memory: state after the sample before.
            measurement_deg: (B,) NaN where there is none [deg].
            variance: R, one for all or (B,) [deg^2].
            sample_time: T [s].
            parts: which act.
            predicted_by: all other inputs of the graph, by name.
        """
        batch = len(measurement_deg)
        bend, half_width, *after = self.file.run(
            **predicted_by,
            measurement_deg=measurement_deg,
            variance=np.broadcast_to(np.maximum(np.asarray(variance, dtype=float), LEAST_VARIANCE), batch),
            sample_time=np.full(batch, sample_time),
            parts=np.array(parts),
            **dict(zip(self.state, memory, strict=True)),
        )
        return bend.astype(float), half_width.astype(float), tuple(after)


def step_network(
    file: TrainedFile, predicted_by: Mapping[str, tuple[int, ...]], state: Mapping[str, int]
) -> StepNetwork:
    """Return the graph of a trained file, tried on zeros.

    Args:
        file: the trained file.
        predicted_by: shape for one filter of each input that it predicts by.
        state: axes for one filter of each array of its state.

    Raises:
        ValueError: the graph has other inputs, or returns something else.
    """
    names = (*predicted_by, *OF_SAMPLE, *state)
    found = {part.name: tuple(part.shape) for part in file.session.get_inputs()}
    if set(found) != set(names):
        raise InputError(f"its inputs are {shown(list(found))}, not {', '.join(names)}")
    shapes = {name: found[name][1:] for name in state}
    sizes = [size for shape in shapes.values() for size in shape]
    fits = all(isinstance(size, int) and 0 < size <= _LARGEST_STATE for size in sizes)
    if not fits or [len(shape) for shape in shapes.values()] != list(state.values()):
        raise InputError(f"the shapes of its state are {shown(tuple(shapes.values()))}")
    memory = {name: (_BATCH, *shape) for name, shape in shapes.items()}
    inputs = {name: (_BATCH, *shape) for name, shape in predicted_by.items()}
    inputs |= dict.fromkeys(OF_SAMPLE, (_BATCH,)) | {"parts": (len(ALL_PARTS),)} | memory
    outputs = dict.fromkeys(OUTPUTS, (_BATCH,)) | {f"{name}_after": of for name, of in memory.items()}
    check_network(file, inputs, outputs, positive=("variance", "sample_time"), precisions=PRECISIONS)
    return StepNetwork(file, shapes)
