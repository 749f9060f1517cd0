"""The active model with a learned gain: the filter around the gain, what the gain sees, what it learns."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from models import COLEMAN_HODGDON
from torch_network import as_estimator

from rl.export import export_step
from rl.kalman_net import ERROR_GAIN_LIMIT, KalmanNetStep, train_kalman_net
from rl.policies import log_scale
from rl.supervised import SequenceTraining
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.load import load_estimator
from twin.hysteresis import PrandtlIshlinskii

T = 0.1
SHORT = SequenceTraining(iterations=250, sequences=32, window=25, hidden=16, learning_rate=1e-2, seed=1)
AFFINE = [COLEMAN_HODGDON, PrandtlIshlinskii((10.0, 8.0, 6.0), (0.0, 0.3, 0.8))]


@pytest.fixture(scope="module")
def trained(records, model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kalman_net")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rl.kalman_net.EPISODE", 75)
        return load_estimator(train_kalman_net(records, ActiveModel(model, T), SHORT, folder), Sensor(0.1))


@pytest.fixture(scope="module")
def stacked(records):
    """Pull, truth and measurement (3, N)."""
    pull, bend = (np.stack(values) for values in zip(*records, strict=True))
    return pull, bend, bend + np.sqrt(0.1) * np.random.default_rng(4).standard_normal(bend.shape)


def constant(model, of_bend, of_error):
    """A filter whose gains are the same whatever the network sees."""
    step = KalmanNetStep(4)
    parts = torch.tensor([of_bend, of_error / ERROR_GAIN_LIMIT], dtype=torch.float64)
    with torch.no_grad():
        step.output.weight.zero_()
        step.output.bias.copy_(torch.logit(parts))
    return as_estimator(step, model)


def test_it_filters_the_noise_that_it_was_trained_on(trained, stacked):
    """From 20 degrees off, all samples but the given one."""
    pull, bend, measurement = stacked
    error = trained.estimate(pull, measurement, bend[:, 0] + 20) - bend
    assert np.sqrt((error[:, 1:] ** 2).mean()) < 0.8 * np.sqrt(0.1)


@pytest.mark.parametrize("reference", AFFINE, ids=lambda reference: reference.name)
@settings(max_examples=15)
@given(of_bend=st.floats(0.01, 0.99), of_error=st.floats(0.01, 0.99 * ERROR_GAIN_LIMIT))
def test_with_a_constant_gain_it_is_the_constant_gain_filter(reference, stacked, of_bend, of_error):
    pull, _, measurement = (values[:, :40] for values in stacked)
    filtered = constant(reference, of_bend, of_error).estimate(pull, measurement, 40.0)
    bend, error, memory = np.full(3, 40.0), np.zeros(3), reference.start(pull[:, 0])
    for k in range(1, pull.shape[1]):
        bend, memory = reference.step(bend, memory, pull[:, k], pull[:, k - 1])
        bend += error * T
        innovation = measurement[:, k] - bend
        bend, error = bend + of_bend * innovation, error + of_error * innovation
        np.testing.assert_allclose(filtered[:, k], bend, atol=1e-4)


@settings(max_examples=20)
@given(seed=st.integers(0, 99), size=st.floats(1e-3, 1e6))
def test_gains_are_bounded_whatever_the_network_sees(seed, size):
    torch.manual_seed(seed)
    step = KalmanNetStep(8)
    zero, one = torch.zeros(20), torch.ones(20)
    measured = size * torch.randn(20)
    after = step(one, zero, measured, one, T * one, *step.start(size * torch.randn(20)))
    innovation = measured - after[0] + after[3]  # of_bend is what was added to the prediction
    assert all(torch.isfinite(of).all() for of in after)
    assert (after[3].abs() <= innovation.abs() * (1 + 1e-5)).all()
    assert (after[4].abs() <= ERROR_GAIN_LIMIT * innovation.abs() * (1 + 1e-5)).all()


class Watched(torch.nn.GRUCell):
    """Keeps what it is shown."""

    shown: list = []  # noqa: RUF012

    def forward(self, seen, memory):
        self.shown.append(seen.numpy().copy())
        return super().forward(seen, memory)


def test_the_network_sees_the_features_of_the_paper_less_the_prediction_of_the_model(model, stacked):
    pull, _, measurement = stacked
    torch.manual_seed(0)
    step = KalmanNetStep(8)
    step.cell = Watched(5, 8)
    Watched.shown.clear()
    estimator = as_estimator(step, model, measurement_variance=4.0)
    states = [estimator.start(pull[:, 0], np.full(3, 40.0))]
    for k in range(1, 30):
        states.append(estimator.step(states[-1], pull[:, k], pull[:, k - 1], measurement[:, k]))
    bend = np.array([state.bend_deg for state in states])
    error = np.array([state.memory[1] for state in states])
    y = np.concatenate([np.full((1, 3), 40.0), measurement.T[1:30]])

    def predicted(angle, k):
        return model.step(angle, np.empty((0, 3)), pull[:, k], pull[:, k - 1])[0]

    for k in range(2, 30):
        measured = y[k] - predicted(y[k - 1], k)
        innovation = y[k] - predicted(bend[k - 1], k) - error[k - 1] * T
        evolved = bend[k - 1] - predicted(bend[k - 2], k - 1)
        corrected = evolved - error[k - 2] * T
        of_error = (error[k - 1] - error[k - 2]) * T
        expected = np.stack([measured, innovation, evolved, corrected, of_error], axis=-1) / 2.0
        np.testing.assert_allclose(Watched.shown[k - 1], log_scale(torch.tensor(expected)), atol=1e-6)


def test_over_a_gap_it_predicts_and_the_network_rests(trained, stacked):
    pull, bend, measurement = stacked
    state = trained.start(pull[:, 0], bend[:, 0])
    for k in range(1, 70):
        y = measurement[:, k].copy()
        if k >= 60:
            y[1] = np.nan
        before, state = state, trained.step(state, pull[:, k], pull[:, k - 1], y)
    predicted, _ = trained.model.step(before.bend_deg, before.following, pull[:, 69], pull[:, 68])
    predicted += before.memory[1] * T
    np.testing.assert_allclose(state.bend_deg[1], predicted[1], atol=1e-12)
    assert np.array_equal(state.memory[5][1], before.memory[5][1])
    assert not np.array_equal(state.memory[5][0], before.memory[5][0])


def test_the_exported_graph_is_the_step(stacked, tmp_path):
    torch.manual_seed(1)
    step = KalmanNetStep(6)
    description = {"agent": "kalman-net", "active_model": ActiveModel(COLEMAN_HODGDON, T).to_dict()}
    export_step(step, dict.fromkeys(step.inputs, ()), step.state, description, tmp_path / "a.onnx")
    pull, _, measurement = stacked
    holed = np.where(np.arange(measurement.shape[1]) % 97 == 40, np.nan, measurement)
    found = load_estimator(tmp_path / "a.onnx", Sensor(0.1)).estimate(pull, holed, 60.0)
    wanted = as_estimator(step, COLEMAN_HODGDON).estimate(pull, holed, 60.0)
    np.testing.assert_allclose(found, wanted, atol=1e-8)
