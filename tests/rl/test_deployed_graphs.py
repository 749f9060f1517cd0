"""Deployed graphs of the filters that learn on twins against the code that trained them, along a stream.

`make endurance` compares a hundred thousand samples of each. Networks have weights as they are drawn: what is
compared is the export and the runtime, whatever was learned.
"""

import numpy as np
import pytest
import torch
from exported import filtered_by_both
from small_twins import TINY, generator, small_memory_source, small_memory_step, small_source, small_step

from rl.twins.graph import StepGraph, export_twins, export_with_model
from twin.estimation.learned.trained_file import read_trained_file

pytestmark = pytest.mark.usefixtures("own_exporter")
LENGTHS = [300, pytest.param(100_000, marks=pytest.mark.endurance)]
SINGLE = 1e-5
"""Largest difference [deg], or share of an angle beyond 1 deg: single precision holds 1e-7 of one number."""


@pytest.mark.slow
@pytest.mark.parametrize("samples", LENGTHS)
@pytest.mark.parametrize("method", ["ram-twins", "ram-memory"])
def test_filter_step(method, samples, tmp_path):
    """A step learns in single precision and is deployed in double: within the rounding of the former.

    A filter adds up roundings of its covariance and of weighted members: 2e-5 to 4e-5 of an angle, by the
    processor, which do not grow with the length of the stream.
    """
    path = tmp_path / "policy.onnx"
    if method == "ram-twins":
        step, source = small_step(), small_source()
        graph, names = StepGraph(step), ("members_deg", "way_mm")
        export_twins(step, TINY.members, {"agent": method}, path)
    else:
        step, source = small_memory_step(loud=0.3), small_memory_source()
        graph, names = StepGraph(step), ("keep", "drive_deg", "increment_mm")
        export_with_model(step, {"agent": method}, path)
    names = (*names, *step.start(torch.ones(1))._fields)
    drawn = source.draw(1, 150, generator(3), stride=5)
    for precision in (torch.float64, torch.float32):  # as deployed, as trained
        is_double = precision == torch.float64
        worst = max(
            float((abs(found - wanted) / (1 if is_double else np.maximum(abs(wanted), 1))).max())
            for found, wanted in filtered_by_both(
                graph, read_trained_file(path), names, drawn, samples, lambda k: k % 97 == 40, precision
            )
        )
        assert worst < (SINGLE / 10 if is_double else 10 * SINGLE)
