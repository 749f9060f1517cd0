"""The graph of RAM (twins) as it is deployed: the trained step with its state as named arrays."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from rl.export import export_module
from rl.twins.step import FilterState, TwinsStep
from twin.estimation.learned.ram_twins import INPUTS, OUTPUTS, STATE

_BATCH = 3  # of the example that the export traces; any number may come


class StepGraph(torch.nn.Module):
    """The step with plain arrays in and out; a state that is all zero stands for the first one."""

    def __init__(self, step: TwinsStep):
        super().__init__()
        self.step = step

    def forward(
        self,
        members_deg: torch.Tensor,
        way_mm: torch.Tensor,
        measurement_deg: torch.Tensor,
        variance: torch.Tensor,
        sample_time: torch.Tensor,
        parts: torch.Tensor,
        mean: torch.Tensor,
        covariance: torch.Tensor,
        counts: torch.Tensor,
        samples: torch.Tensor,
        statistics: torch.Tensor,
    ) -> tuple[torch.Tensor, ...]:
        """Return estimate, half of its interval, and the arrays of the state after the sample."""
        step = self.step
        begins = 1 - torch.sign((covariance @ step.of_error) @ step.of_error)
        covariance = covariance + begins[:, None, None] * step.first_covariance(variance)
        state = FilterState(mean, covariance, counts, samples, statistics)
        output, after = step(members_deg, way_mm, measurement_deg, variance, sample_time, parts, state)
        return (output.bend_deg, output.half_width_deg, *after)


def export_step(step: TwinsStep, members: int, description: Mapping[str, Any], path: Path) -> None:
    """Write a trained step as ONNX, whole or not at all.

    Args:
        step: trained.
        members: M.
        description: plain values that travel with it.
        path: the file.
    """
    # Tensors of their own: the export takes one that is given twice for one input.
    each = [torch.ones(_BATCH) for _ in INPUTS[1:-1]]
    inputs = dict(zip(INPUTS, (torch.zeros(_BATCH, members), *each, torch.ones(2)), strict=True))
    inputs |= dict(zip(STATE, step.start(torch.ones(_BATCH)), strict=True))
    outputs = [*OUTPUTS, *(f"{name}_after" for name in STATE)]
    free = {name: [0] for name in inputs if name != "parts"}
    export_module(StepGraph(step), inputs, outputs, free, description, path)
