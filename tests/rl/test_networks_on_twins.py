"""Rivals that learn on twins: what is written is what was trained, and the full suite has them on request."""

import dataclasses

import numpy as np
import pytest
import torch
from exported import said_by_both
from small_twins import MODEL, TINY_MEMORY, generator, small_memory_source

from rl.on_twins import RIVALS
from rl.twins.filter_step import ALL
from rl.twins.graph import export_with_model
from rl.twins.learning import filter_sequences, learn_gain
from twin.estimation.load import load_estimator
from twin.hysteresis import model_to_dict


def loud_step(name):
    """An untrained step that says something."""
    torch.manual_seed(0)
    step = RIVALS[name].untrained()
    with torch.no_grad():
        step.output[-1].weight.normal_(0, 0.5)
    return step.eval()


@pytest.mark.parametrize("name", RIVALS)
def test_the_estimator_says_what_the_step_says(name, tmp_path):
    """Along whole records, for any number of them, where measurements are missing too."""
    training, step = RIVALS[name].spec.training, loud_step(name)
    path = tmp_path / training.file
    export_with_model(step, {"agent": training.agent, "model": model_to_dict(MODEL)}, path)
    for found, wanted in said_by_both(step, load_estimator(path)):
        np.testing.assert_allclose(found, wanted, rtol=2e-3, atol=5e-3)


@pytest.mark.slow
def test_likelihood_teaches_a_variance_that_is_that_of_the_errors():
    """Before, the variance that a recursive gain states is far above the square of its errors."""
    torch.manual_seed(0)
    step, source = RIVALS["Recursive KalmanNet (twins)"].untrained(), small_memory_source(("gaussian",))
    settings = dataclasses.replace(TINY_MEMORY, noises=("gaussian",), updates=120, sequences=32)

    def ratio():
        drawn = source.draw(200, 40, generator(9), stride=5)
        with torch.no_grad():
            outputs = [output for output, _ in filter_sequences(step, drawn, ALL)]
        error = torch.stack([output.bend_deg for output in outputs]) - drawn.truth_deg
        deviation = torch.stack([output.deviation_deg for output in outputs])
        return float(((error / deviation)[10:] ** 2).mean())

    before = ratio()
    learn_gain(step, source.draw, settings)
    assert abs(np.log(ratio())) < min(abs(np.log(before)), np.log(2.5))


@pytest.mark.slow
def test_likelihood_leaves_a_recursive_gain_below_one():
    """Where first errors are many deviations, estimates are still better than the measurements."""
    torch.manual_seed(0)
    source = small_memory_source(("gaussian", "salt-and-pepper", "gamma"))
    step = RIVALS["Recursive KalmanNet (twins)"].untrained()
    learn_gain(step, source.draw, dataclasses.replace(TINY_MEMORY, updates=120, sequences=64))
    drawn = source.draw(200, 40, generator(9), stride=5)
    with torch.no_grad():
        found = torch.stack([output.bend_deg for output, _ in filter_sequences(step, drawn, ALL)])
    square, of_measurement = (
        ((of - drawn.truth_deg)[10:] ** 2).mean(dim=0) for of in (found, drawn.measurement_deg)
    )
    assert torch.log(square / of_measurement).mean() < np.log(0.7)
