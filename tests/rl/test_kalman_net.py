import json
import pickle

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from models import COLEMAN_HODGDON
from recorded import make_episode
from torch_network import TorchNetwork

import scripts.train
from rl.kalman_net import (
    ERROR_GAIN_LIMIT,
    GainNetwork,
    KalmanNetTraining,
    train_kalman_net,
)
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.learned.kalman_net import FEATURES, KalmanNet, load
from twin.estimation.learned.trained_file import read_trained_file
from twin.hysteresis import BoucWen, PrandtlIshlinskii
from twin.recording import write_episode

T = 0.1
SHORT = KalmanNetTraining(iterations=250, sequences=32, window=25, episode=75, learning_rate=1e-2, seed=1)
AFFINE = [COLEMAN_HODGDON, PrandtlIshlinskii((10.0, 8.0, 6.0), (0.0, 0.3, 0.8))]


@pytest.fixture(scope="module")
def trained(records, model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kalman_net")
    return load(train_kalman_net(records, ActiveModel(model, T), SHORT, folder)), folder


@pytest.fixture(scope="module")
def stacked(records):
    """Pull, truth and measurement (3, N)."""
    pull, bend = (np.stack(values) for values in zip(*records, strict=True))
    return pull, bend, bend + np.sqrt(0.1) * np.random.default_rng(4).standard_normal(bend.shape)


def constant(model, of_bend, of_error):
    """Weights that say the same gains whatever they see."""
    network = GainNetwork(4)
    parts = torch.tensor([of_bend, of_error / ERROR_GAIN_LIMIT], dtype=torch.float64)
    with torch.no_grad():
        network.output.weight.zero_()
        network.output.bias.copy_(torch.logit(parts))
    return KalmanNet(TorchNetwork(network, 4), model, T)


def test_it_filters_the_noise_that_it_was_trained_on(trained, stacked):
    """From 20 degrees off, all samples but the given one."""
    pull, bend, measurement = stacked
    error = trained[0].estimate(pull, measurement, bend[:, 0] + 20) - bend
    assert np.sqrt((error[:, 1:] ** 2).mean()) < 0.8 * np.sqrt(0.1)


@pytest.mark.parametrize("reference", AFFINE, ids=lambda reference: reference.name)
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


def test_with_the_steady_gain_of_the_active_model_it_is_the_active_model(model):
    """While the command rests, the Kalman gain of constant Q and R converges; from there the two are one."""
    rest = np.full(400, 3.0)
    measurement = 60 + np.random.default_rng(1).standard_normal((1, 400))
    active = ActiveModel(model, T, (1e-2, 1e-1), 1.0)
    belief = active.start(rest[:1], measurement[:, 0])
    for k in range(1, 200):
        belief = active.step(belief, rest[:1], rest[:1], measurement[:, k])
    spread = active.predict(belief, rest[:1], rest[:1]).covariance[:, :, 0]
    gain = spread[:, 0] / (spread[0, 0] + 1.0)
    network = constant(model, *gain)
    state = network.start(rest[:1], belief.mean[0])
    state = state._replace(filter=state.filter._replace(error=belief.mean[1]))
    for k in range(200, 400):
        belief = active.step(belief, rest[:1], rest[:1], measurement[:, k])
        state = network.step(state, rest[:1], rest[:1], measurement[:, k])
        np.testing.assert_allclose(network.bend_deg(state), active.bend_deg(belief), atol=1e-4)


@given(seed=st.integers(0, 99), size=st.floats(0, 1e6))
def test_gains_are_bounded_whatever_the_network_sees(seed, size):
    torch.manual_seed(seed)
    network = GainNetwork(8)
    gain, hidden = network(size * torch.randn(20, FEATURES), torch.randn(1, 20, 8))
    assert torch.isfinite(hidden).all()
    assert ((gain >= 0) & (gain <= torch.tensor([1.0, ERROR_GAIN_LIMIT]))).all()


class Watched(GainNetwork):
    """Keeps what it is shown."""

    def forward(self, seen, memory):
        self.shown = [*getattr(self, "shown", []), seen.numpy().copy()]
        return super().forward(seen, memory)


def test_network_sees_the_features_of_the_paper_less_what_the_model_foretells(model, stacked):
    pull, _, measurement = stacked
    torch.manual_seed(0)
    network = Watched(8)
    estimator = KalmanNet(TorchNetwork(network, 8), model, T, 4.0)
    states = [estimator.start(pull[:, 0], np.full(3, 40.0))]
    for k in range(1, 30):
        states.append(estimator.step(states[-1], pull[:, k], pull[:, k - 1], measurement[:, k]))
    bend = np.array([state.filter.bend_deg for state in states])
    error = np.array([state.filter.error for state in states])
    y = np.concatenate([np.full((1, 3), 40.0), measurement.T[1:30]])

    def step(angle, k):
        return model.step(angle, np.empty((0, 3)), pull[:, k], pull[:, k - 1])[0]

    for k in range(2, 30):
        measured = y[k] - step(y[k - 1], k)
        innovation = y[k] - step(bend[k - 1], k) - error[k - 1] * T
        evolved = bend[k - 1] - step(bend[k - 2], k - 1)
        corrected = evolved - error[k - 2] * T
        of_error = (error[k - 1] - error[k - 2]) * T
        expected = np.stack([measured, innovation, evolved, corrected, of_error], axis=-1) / 2.0
        np.testing.assert_allclose(network.shown[k - 1], expected, atol=1e-4)


@given(factor=st.floats(0.1, 10), shift=st.floats(-30, 30))
def test_error_scales_with_the_noise_that_it_is_told(trained, stacked, factor, shift):
    """About any response of the model, the error of the initial estimate being scaled too."""
    estimator, _ = trained
    pull, _, measurement = (values[:, :60] for values in stacked)
    start = measurement[:, 0]
    response = estimator.model.response(pull, start)
    moved = estimator.model.response(pull, start + shift)
    away = estimator.estimate(pull, measurement, start + 10) - response
    told = estimator.with_sensor(Sensor(0.1 * factor**2))
    scaled = told.estimate(pull, moved + factor * (measurement - response), start + shift + 10 * factor)
    np.testing.assert_allclose(scaled - moved, factor * away, atol=5e-4 * max(factor, 1))


def test_batch_along_one_command_equals_one_by_one(trained, stacked):
    estimator, _ = trained
    pull, bend, _ = stacked
    measurement = bend[0] + np.random.default_rng(2).standard_normal((4, bend.shape[1]))
    R = np.array([0.1, 0.5, 1.0, 5.0])
    single = [
        estimator.with_sensor(Sensor(r)).estimate(pull[0], row, 45.0)
        for r, row in zip(R, measurement, strict=True)
    ]
    batch = estimator.with_sensor(Sensor(R)).estimate(pull[0], measurement, 45.0)
    np.testing.assert_allclose(batch, np.concatenate(single), atol=1e-4)


@pytest.mark.parametrize("reference", AFFINE, ids=lambda reference: reference.name)
def test_without_measurements_it_is_the_model(reference, stacked):
    pull, _, measurement = stacked
    alone = constant(reference, 0.3, 0.1).estimate(pull, np.full_like(measurement, np.nan), 40.0)
    np.testing.assert_allclose(alone, reference.response(pull, np.full(3, 40.0)), atol=1e-9)


def test_over_a_gap_it_predicts_and_the_network_rests(trained, stacked):
    estimator, _ = trained
    pull, bend, measurement = stacked
    state = estimator.start(pull[:, 0], bend[:, 0])
    for k in range(1, 100):
        y = measurement[:, k].copy()
        if 60 <= k < 70:
            y[1] = np.nan
        before, state = state, estimator.step(state, pull[:, k], pull[:, k - 1], y)
        if 60 <= k < 70:
            one = slice(1, 2)
            predicted, _ = estimator.model.step(
                before.filter.bend_deg[one], before.memory[:, one], pull[one, k], pull[one, k - 1]
            )
            predicted += before.filter.error[one] * T
            np.testing.assert_allclose(estimator.bend_deg(state)[one], predicted, atol=1e-12)
            assert np.array_equal(state.filter.hidden[1], before.filter.hidden[1])
            assert state.filter.error[1] == before.filter.error[1]
            assert not np.array_equal(state.filter.hidden[0], before.filter.hidden[0])
    holed = measurement.copy()
    holed[1, 60:70] = np.nan
    np.testing.assert_allclose(
        estimator.estimate(pull, holed, bend[:, 0])[:, 99], estimator.bend_deg(state), atol=1e-4
    )


def test_model_that_is_not_affine_is_refused(records, tmp_path):
    model = BoucWen(22.0, -12.0, 1.1, 1.0, 1.5)
    with pytest.raises(ValueError, match="'bouc-wen' is not affine"):
        KalmanNet(TorchNetwork(GainNetwork(4), 4), model, T)
    with pytest.raises(ValueError, match="'bouc-wen' is not affine"):
        train_kalman_net(records, ActiveModel(model, T), SHORT, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_saved_network_is_loaded_and_equal(trained, stacked, records, model):
    estimator, folder = trained
    pull, _, measurement = stacked
    expected = estimator.estimate(pull, measurement, 45.0)
    for again in (
        load(train_kalman_net(records, ActiveModel(model, T), SHORT, folder)),
        load(folder / "kalman_net.onnx"),
        pickle.loads(pickle.dumps(estimator)),
    ):
        np.testing.assert_array_equal(again.estimate(pull, measurement, 45.0), expected)
        assert (again.model, again.sample_time) == (model, T)
    assert read_trained_file(folder / "kalman_net.onnx").description["training"]["window"] == SHORT.window


def test_file_that_is_no_network_is_refused_in_one_line(trained, tmp_path):
    whole = (trained[1] / "kalman_net.onnx").read_bytes()
    path = tmp_path / "kalman_net.onnx"
    with pytest.raises(FileNotFoundError, match="no trained file"):
        load(path)
    for content in (b"nothing", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"is not a trained file written by `endotwin train`") as e:
            load(path)
        assert "\n" not in str(e.value)


def test_the_verb_trains_it(tmp_path, model, capsys):
    write_episode(tmp_path / "one.mcap", make_episode(samples=40))
    (tmp_path / "model.json").write_text(json.dumps(model.to_dict()))
    line = f"{tmp_path}/one.mcap --model {tmp_path}/model.json --out {tmp_path}/run --agent kalman-net"
    options = ["--sample-time", "0.02", "--initial-error-deg", "7", "--episodes", "3", "--json"]
    assert scripts.train.main([*line.split(), *options]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary == {"out": f"{tmp_path}/run/kalman_net.onnx", "agent": "kalman-net"}
    assert load(tmp_path / "run/kalman_net.onnx").sample_time == 0.02
    # shorter than an episode of the defaults: 64 filters over the 39 steps that there are
    assert [row.split(",")[0] for row in (tmp_path / "run/progress.csv").read_text().split()[1:]] == [
        str(64 * 39),
        str(2 * 64 * 39),
    ]
    assert "initial_error_deg: 7.0" in (tmp_path / "run/config.yaml").read_text()
