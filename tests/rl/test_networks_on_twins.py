"""Rivals that learn on twins: what is written is what was trained, and the full suite has them on request."""

import dataclasses

import numpy as np
import pytest
import torch
from small_twins import MODEL, TINY_MEMORY, generator, small_memory_source, twins

from rl.networks_on_twins import STEPS
from rl.suite.settings import FullSuite
from rl.supervised import tensor32
from rl.twins.beside_model import train_beside_model
from rl.twins.filter_step import ALL
from rl.twins.graph import export_recurrent_step
from rl.twins.learning import filter_sequences, learn_gain
from twin.estimation.estimator import Sensor
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.registry import find_method
from twin.hysteresis import model_to_dict


def loud_step(name):
    """An untrained step that says something."""
    torch.manual_seed(0)
    step = STEPS[name][1]()
    with torch.no_grad():
        step.output[-1].weight.normal_(0, 0.5)
    return step.eval()


@pytest.mark.parametrize("name", STEPS)
def test_the_estimator_says_what_the_step_says(name, tmp_path):
    """Along whole records, for any number of them, where measurements are missing too."""
    training, step, source = STEPS[name][0].training, loud_step(name), small_memory_source()
    path = tmp_path / training.file
    export_recurrent_step(step, {"agent": training.agent, "model": model_to_dict(MODEL)}, path)
    for count in (1, 4):
        command, index = np.arange(count), np.arange(0, 31 * 5, 5)[:, None]
        pull = source.records.pull_mm[command, index].astype(float)
        measurement = pull * 20 + generator(count).standard_normal(pull.shape)
        measurement[8:10, 0] = np.nan
        variance = np.linspace(0.3, 2.0, count)
        inputs = source.predict(source.records, command, index)
        state, wanted = step.start(tensor32(variance)), []
        with torch.no_grad():
            for *by, y in zip(*inputs, tensor32(measurement[1:]), strict=True):
                output, state = step(*by, y, tensor32(variance), torch.full((count,), 0.1), ALL, state)
                wanted.append(torch.stack([output.bend_deg, output.half_width_deg]))
        estimator = training.load(path).with_sensor(Sensor(variance))
        found = estimator.estimate_with_interval(pull.T, measurement.T, 0.0)
        np.testing.assert_allclose(
            np.array(found)[:, :, 1:], torch.stack(wanted).permute(1, 2, 0), rtol=2e-3, atol=5e-3
        )


def test_a_training_writes_a_file_of_its_own_agent_and_no_other_reads_it(tmp_path):
    spec, make = STEPS["KalmanNet (twins)"]
    path = train_beside_model(spec.training, make, export_recurrent_step, *twins(), TINY_MEMORY, tmp_path)
    assert read_trained_file(path).description["training"]["seed"] == TINY_MEMORY.seed
    assert spec.training.load(path).states_interval
    with pytest.raises(ValueError, match="gru-twins"):
        STEPS["GRU (twins)"][0].training.load(path)


def test_likelihood_teaches_a_variance_that_is_that_of_the_errors():
    """Before, the variance that a recursive gain states is far above the square of its errors."""
    torch.manual_seed(0)
    step, source = STEPS["Recursive KalmanNet (twins)"][1](), small_memory_source(("gaussian",))
    settings = dataclasses.replace(TINY_MEMORY, noises=("gaussian",), updates=120, sequences=32)

    def ratio():
        drawn = source.draw(200, 40, generator(9), stride=5)
        with torch.no_grad():
            outputs = [output for output, _ in filter_sequences(step, drawn, ALL)]
        error = torch.stack([output.bend_deg for output in outputs]) - drawn.truth_deg
        deviation = torch.stack([output.deviation_deg for output in outputs])
        return float(((error / deviation)[10:] ** 2).mean())

    before = ratio()
    learn_gain(step, source, settings)
    assert abs(np.log(ratio())) < min(abs(np.log(before)), np.log(2.5))


def test_the_full_suite_has_them_only_where_they_are_named_or_given(tmp_path):
    def names(**changes):
        return {spec.name for spec in FullSuite(tmp_path, **changes).specs}

    assert names().isdisjoint(STEPS)
    assert names(methods=("GRU (twins)", "AM")) == {"GRU (twins)", "AM"}
    given = names(trained={"ssm-twins": (tmp_path / "network.onnx",)})
    assert given & set(STEPS) == {"SSM (twins)"}
    assert all(find_method(name).on_request for name in STEPS)
