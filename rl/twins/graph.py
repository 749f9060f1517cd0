"""The graph that is deployed: a trained step with its state as named arrays, in double precision."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from rl.export import export_step
from rl.twins.filter_step import FilterStep
from rl.twins.step import TwinsStep
from twin.estimation.learned.step import ALL_PARTS, PARTS

_BY_MODEL: dict[str, tuple[int, ...]] = dict.fromkeys(("keep", "drive_deg", "increment_mm"), ())
_OF_SAMPLE: dict[str, tuple[int, ...]] = dict.fromkeys(
    ("measurement_deg", "variance", "zero_deviation_deg", "sample_time"), ()
)
_OF_SAMPLE |= {PARTS: (len(ALL_PARTS),)}


class StepGraph(torch.nn.Module):
    """A step with plain arrays in and out; a state that is all zero stands for the first one."""

    def __init__(self, step: FilterStep):
        super().__init__()
        self.step = step
        self._state = type(step.start(torch.ones(1)))

    def forward(self, *arguments: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return estimate, half of its interval, and the arrays of the state after the sample.

        Arguments are the inputs of the step, which end in R, the deviation of the zero, T and parts, and the
        arrays of its state.
        """
        count = len(arguments) - len(self._state._fields)
        given, state = arguments[:count], self._state(*arguments[count:])
        output, after = self.step(*given, self.step.begun(state, given[-3]))
        return (output.bend_deg, output.half_width_deg, *after)


def export_twins(step: TwinsStep, members: int, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained step of RAM (twins) on M members as ONNX, complete or not at all."""
    _export(step, {"members_deg": (members,), "way_mm": ()}, description, path)


def export_with_model(step: FilterStep, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained step that predicts by a model as ONNX, complete or not at all."""
    _export(step, _BY_MODEL, description, path)


def _export(
    step: FilterStep, inputs: Mapping[str, tuple[int, ...]], description: Mapping[str, Any], path: Path
) -> None:
    state = {name: tuple(of.shape[1:]) for name, of in step.start(torch.ones(2))._asdict().items()}
    export_step(
        StepGraph(step), {**inputs, **_OF_SAMPLE}, state, description, path, ("bend_deg", "half_width_deg")
    )
