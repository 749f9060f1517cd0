"""The graphs that are deployed: a trained step with its state as named arrays, in double precision."""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from rl.export import export_module
from rl.twins.filter_state import FilterState
from rl.twins.filter_step import FilterStep
from rl.twins.memory_step import MemoryState, MemoryStep
from rl.twins.products import along
from rl.twins.recurrent_step import RecurrentState, RecurrentStep
from rl.twins.step import TwinsStep
from twin.estimation.learned import networks_on_twins, ram_memory, ram_twins
from twin.estimation.learned.model_step import PREDICTED_BY
from twin.estimation.learned.step_network import ALL_PARTS, OF_SAMPLE, OUTPUTS

_REFERENCE_STEPS = 8  # that the trained step itself computes, and the file tells
_BATCH = 3  # of the example that the export traces; any number may come

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
    """Write a trained step of RAM (twins) on M members as ONNX, whole or not at all."""
    predicted_by = {"members_deg": torch.zeros(_BATCH, members), "way_mm": torch.ones(_BATCH)}
    _export(TwinsGraph(step), step, predicted_by, list(ram_twins.STATE), description, path)


def export_memory(step: MemoryStep, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained step of RAM (memory) as ONNX, whole or not at all."""
    predicted_by = {name: torch.ones(_BATCH) for name in PREDICTED_BY}
    _export(MemoryGraph(step), step, predicted_by, list(ram_memory.STATE), description, path)


def export_recurrent_step(step: RecurrentStep, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained network or gain as ONNX, whole or not at all."""
    predicted_by = {name: torch.ones(_BATCH) for name in PREDICTED_BY}
    _export(RecurrentStepGraph(step), step, predicted_by, list(networks_on_twins.STATE), description, path)


def _export(
    graph: torch.nn.Module,
    step: FilterStep,
    predicted_by: Mapping[str, Tensor],
    state: list[str],
    description: Mapping[str, Any],
    path: Path,
) -> None:
    # A filter adds up the roundings of its covariance: single precision would part the graph from the step.
    graph = copy.deepcopy(graph).double()
    # Tensors of their own: the export takes one that is given twice for one input.
    inputs = {**predicted_by} | {name: torch.ones(_BATCH) for name in OF_SAMPLE}
    inputs["parts"] = torch.tensor(ALL_PARTS)
    inputs |= {name: of.clone() for name, of in zip(state, step.start(torch.ones(_BATCH)), strict=True)}
    inputs = {name: of.double() for name, of in inputs.items()}
    outputs = [*OUTPUTS, *(f"{name}_after" for name in state)]
    free = {name: [0] for name in inputs if name != "parts"}
    export_module(graph, inputs, outputs, free, description, path, _reference(inputs, state))


def _reference(inputs: Mapping[str, Tensor], state: list[str]) -> dict[str, Tensor]:
    """Return inputs of a few steps."""
    rng = torch.Generator().manual_seed(0)  # of its own: what is drawn for a training stays as it is

    def drawn(*shape: int) -> Tensor:
        return torch.randn(_REFERENCE_STEPS, *shape, generator=rng, dtype=torch.float64)

    given = {name: drawn(*of.shape) for name, of in inputs.items() if name not in state and name != "parts"}
    for name in given.keys() & {"way_mm", "keep"}:
        given[name] = torch.sigmoid(given[name])
    given["measurement_deg"][1, 0] = torch.nan
    given["variance"] = torch.exp(given["variance"])
    given["sample_time"] = torch.full_like(given["sample_time"], 0.1)
    parts = torch.tensor(ALL_PARTS, dtype=torch.float64).repeat(_REFERENCE_STEPS, 1)
    return {name: parts if name == "parts" else given[name] for name in inputs if name not in state}
