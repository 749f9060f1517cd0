"""The graphs that are deployed: a trained step with its state as named arrays, in double precision."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from rl.export import export_step
from rl.twins.filter_step import FilterStep, along
from rl.twins.memory_step import MemoryState, MemoryStep
from rl.twins.recurrent_step import RecurrentState, RecurrentStep
from rl.twins.step import FilterState, TwinsStep
from twin.estimation.learned.step import ALL_PARTS, PARTS

_BY_MODEL: dict[str, tuple[int, ...]] = {"keep": (), "drive_deg": (), "increment_mm": ()}
_OF_SAMPLE: dict[str, tuple[int, ...]] = {
    "measurement_deg": (),
    "variance": (),
    "sample_time": (),
    PARTS: (len(ALL_PARTS),),
}

Tensor = torch.Tensor


class TwinsGraph(torch.nn.Module):
    """`TwinsStep` with plain arrays in and out; a state that is all zero stands for the first one."""

    def __init__(self, step: TwinsStep):
        super().__init__()
        self.step = step

    def forward(
        self,
        members_deg: Tensor,
        way_mm: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        sample_time: Tensor,
        parts: Tensor,
        mean: Tensor,
        covariance: Tensor,
        counts: Tensor,
        samples: Tensor,
        statistics: Tensor,
        rows: Tensor,
        rows_covariance: Tensor,
        evidence: Tensor,
    ) -> tuple[Tensor, ...]:
        """Return estimate, half of its interval, and the arrays of the state after the sample."""
        step = self.step
        of_error = step.motion.of_error
        begins = 1 - torch.sign(along(along(rows_covariance, of_error), of_error))[:, None, None]
        state = FilterState(
            mean,
            covariance + begins * step.plain.first_covariance(variance),
            counts,
            samples,
            statistics,
            rows,
            rows_covariance + begins * step.motion.first_covariance(variance),
            evidence,
        )
        output, after = step(members_deg, way_mm, measurement_deg, variance, sample_time, parts, state)
        return (output.bend_deg, output.half_width_deg, *after)


class MemoryGraph(torch.nn.Module):
    """`MemoryStep` with plain arrays in and out; a state that is all zero stands for the first one."""

    def __init__(self, step: MemoryStep):
        super().__init__()
        self.step = step

    def forward(
        self,
        keep: Tensor,
        drive_deg: Tensor,
        increment_mm: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        sample_time: Tensor,
        parts: Tensor,
        mean: Tensor,
        covariance: Tensor,
        hidden: Tensor,
        innovation: Tensor,
        samples: Tensor,
    ) -> tuple[Tensor, ...]:
        """Return estimate, half of its interval, and the arrays of the state after the sample."""
        step = self.step
        begins = 1 - torch.sign(covariance.abs().sum(dim=1, keepdim=True))
        state = MemoryState(mean, covariance + begins * step.first, hidden, innovation, samples)
        given = keep, drive_deg, increment_mm, measurement_deg, variance, sample_time
        output, after = step(*given, parts, state)
        return (output.bend_deg, output.half_width_deg, *after)


class RecurrentStepGraph(torch.nn.Module):
    """`RecurrentStep` with plain arrays in and out; zeros are its first state."""

    def __init__(self, step: RecurrentStep):
        super().__init__()
        self.step = step

    def forward(
        self,
        keep: Tensor,
        drive_deg: Tensor,
        increment_mm: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        sample_time: Tensor,
        parts: Tensor,
        values: Tensor,
        hidden: Tensor,
        samples: Tensor,
    ) -> tuple[Tensor, ...]:
        """Return estimate, half of its interval, and the arrays of the state after the sample."""
        given = keep, drive_deg, increment_mm, measurement_deg, variance, sample_time
        output, after = self.step(*given, parts, RecurrentState(values, hidden, samples))
        return (output.bend_deg, output.half_width_deg, *after)


def export_twins(step: TwinsStep, members: int, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained step of RAM (twins) on M members as ONNX, complete or not at all."""
    inputs = {"members_deg": (members,), "way_mm": ()} | _OF_SAMPLE
    _export(TwinsGraph(step), step, inputs, description, path)


def export_memory(step: MemoryStep, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained step of RAM (memory) as ONNX, complete or not at all."""
    _export(MemoryGraph(step), step, _BY_MODEL | _OF_SAMPLE, description, path)


def export_recurrent_step(step: RecurrentStep, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained network or gain as ONNX, complete or not at all."""
    _export(RecurrentStepGraph(step), step, _BY_MODEL | _OF_SAMPLE, description, path)


def _export(
    graph: torch.nn.Module,
    step: FilterStep,
    inputs: Mapping[str, tuple[int, ...]],
    description: Mapping[str, Any],
    path: Path,
) -> None:
    first = step.start(torch.ones(2))._asdict()
    state = {name: tuple(of.shape[1:]) for name, of in first.items()}
    export_step(graph, inputs, state, description, path, ("bend_deg", "half_width_deg"))
