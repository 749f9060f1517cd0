"""LSTM without a model and GRU with one: what they learn, and how their deployed step filters."""

import functools

import numpy as np
import pytest
import torch
from models import COLEMAN_HODGDON
from torch_network import as_estimator

from rl.export import export_step
from rl.recurrent import GruStep, LstmStep, SequenceNetwork, train_gru, train_lstm
from rl.supervised import SequenceTraining
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.load import load_estimator
from twin.hysteresis import PrandtlIshlinskii

SHORT = SequenceTraining(iterations=120, sequences=32, window=100, seed=1)
TRAIN = {"lstm": train_lstm, "gru": train_gru}
AGENTS = ["lstm", pytest.param("gru", marks=pytest.mark.slow)]


@pytest.fixture(scope="module")
def trained(records, model, tmp_path_factory):
    @functools.cache
    def trained(agent):
        path = TRAIN[agent](records, ActiveModel(model, 0.1), SHORT, tmp_path_factory.mktemp(agent))
        return load_estimator(path, Sensor(0.1))

    return trained


@pytest.fixture(scope="module")
def stacked(records):
    """Pull, truth and measurement (3, N)."""
    pull, bend = (np.stack(values) for values in zip(*records, strict=True))
    return pull, bend, bend + np.sqrt(0.1) * np.random.default_rng(4).standard_normal(bend.shape)


@pytest.mark.parametrize("agent", AGENTS)
def test_it_filters_the_noise_that_it_was_trained_on(trained, stacked, agent):
    pull, bend, measurement = stacked
    error = trained(agent).estimate(pull, measurement, bend[:, 0] + 20) - bend
    assert np.sqrt((error[:, 10:] ** 2).mean()) < {"lstm": 0.75, "gru": 0.6}[agent] * np.sqrt(0.1)


@pytest.mark.parametrize("agent", AGENTS)
def test_it_does_not_look_ahead_and_rows_do_not_touch_each_other(trained, stacked, agent):
    estimator = trained(agent)
    pull, _, measurement = stacked
    changed = measurement.copy()
    changed[1, 120:] += 5.0
    first, second = (estimator.estimate(pull, values, 0.0) for values in (measurement, changed))
    np.testing.assert_array_equal(first[:, :120], second[:, :120])
    np.testing.assert_array_equal(first[[0, 2]], second[[0, 2]])
    assert not np.allclose(first[1, 120:], second[1, 120:])
    alone = np.concatenate([estimator.estimate(*of, 0.0) for of in zip(pull, measurement, strict=True)])
    np.testing.assert_allclose(first, alone, atol=1e-9)


@pytest.mark.parametrize("agent", AGENTS)
def test_the_deployed_step_is_the_network_that_was_trained(agent, stacked):
    """From the second sample on: the first measurement is not used, nor is the initial estimate."""
    torch.manual_seed(2)
    pull, _, measurement = stacked
    if agent == "lstm":
        network = SequenceNetwork(torch.nn.LSTM, 6)
        network.input_scale.copy_(torch.tensor([0.3, 2.0]))
        step, unit = LstmStep(network), 1.0
        both = np.stack([pull[:, 1:].T, measurement[:, 1:].T], axis=-1)
        seen = np.diff(both, axis=0, prepend=both[:1])
    else:
        network, unit = SequenceNetwork(torch.nn.GRU, 6), np.sqrt(0.1)
        step = GruStep(network)
        predicted = [
            COLEMAN_HODGDON.step(measurement[:, k - 1], np.empty((0, 3)), pull[:, k], pull[:, k - 1])[0]
            for k in range(2, pull.shape[1])
        ]
        surprise = np.zeros((pull.shape[1] - 1, 3))
        surprise[1:] = (measurement[:, 2:].T - predicted) / unit
        seen = np.stack([surprise, np.diff(pull, axis=1).T], axis=-1)
    with torch.no_grad():
        noise = network.double()(torch.tensor(seen)).numpy().T
    found = as_estimator(step, COLEMAN_HODGDON).estimate(pull, measurement, 50.0)
    np.testing.assert_allclose(found[:, 1:], measurement[:, 1:] - unit * noise, atol=1e-9)
    assert (found[:, 0] == 50).all()


@pytest.mark.parametrize("agent", AGENTS)
def test_the_exported_graph_is_the_step(stacked, agent, tmp_path):
    torch.manual_seed(2)
    kind, step = {"lstm": (torch.nn.LSTM, LstmStep), "gru": (torch.nn.GRU, GruStep)}[agent]
    made = step(SequenceNetwork(kind, 6))
    path = tmp_path / "network.onnx"
    contents = {"agent": agent, "active_model": ActiveModel(COLEMAN_HODGDON, 0.1).to_dict()}
    export_step(made, dict.fromkeys(made.inputs, ()), made.state, contents, path)
    pull, _, measurement = stacked
    holed = measurement.copy()
    holed[1, 1:4], holed[2, 60:70] = np.nan, np.nan
    found, wanted = (
        of.estimate(pull, holed, 50.0)
        for of in (load_estimator(path, Sensor(0.1)), as_estimator(made, COLEMAN_HODGDON))
    )
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_the_lstm_skips_missing_samples_as_if_they_had_not_been(trained, stacked):
    estimator = trained("lstm")
    pull, _, measurement = stacked
    gone = np.random.default_rng(7).random(pull.shape[1]) < 0.3
    gone[[0, 50, 51, 52]] = [False, True, True, True]
    estimate = estimator.estimate(pull, np.where(gone, np.nan, measurement), 50.0)
    dense = estimator.estimate(pull[:, ~gone], measurement[:, ~gone], 50.0)
    np.testing.assert_allclose(estimate[:, ~gone], dense, atol=1e-9)
    np.testing.assert_array_equal(estimate[:, 50:53], estimate[:, [49, 49, 49]])
    nothing = estimator.estimate(pull, np.full_like(measurement, np.nan), 50.0)
    np.testing.assert_array_equal(nothing, np.full_like(measurement, 50.0))


@pytest.mark.parametrize(
    "reference", [COLEMAN_HODGDON, PrandtlIshlinskii((10.0, 8.0, 6.0), (0.0, 0.3, 0.8))], ids=["c-h", "p-i"]
)
def test_without_measurements_the_gru_is_the_model(reference, stacked):
    pull, _, measurement = stacked
    estimator = as_estimator(GruStep(SequenceNetwork(torch.nn.GRU, 8)), reference)
    alone = estimator.estimate(pull, np.full_like(measurement, np.nan), 40.0)
    np.testing.assert_allclose(alone, reference.response(pull, np.full(3, 40.0)), atol=1e-9)
