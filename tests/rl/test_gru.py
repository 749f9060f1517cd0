import json
import pickle

import numpy as np
import onnx
import pytest
import torch
from exported import assert_exported_alike
from hypothesis import given
from hypothesis import strategies as st
from models import COLEMAN_HODGDON
from recorded import make_episode
from torch_network import TorchNetwork

import scripts.train
from rl.gru import GruNetwork, train_gru
from rl.supervised import SequenceTraining
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.learned.gru import Gru, load
from twin.estimation.learned.trained_file import read_trained_file
from twin.hysteresis import BoucWen, PrandtlIshlinskii
from twin.recording import write_episode

SHORT = SequenceTraining(iterations=120, sequences=32, window=80, seed=1)
MODELS = [
    COLEMAN_HODGDON,
    BoucWen(22.0, -12.0, 1.1, 1.0, 1.5),
    PrandtlIshlinskii((10.0, 8.0, 6.0), (0.0, 0.3, 0.8)),
]


@pytest.fixture(scope="module")
def trained(records, model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("gru")
    return load(train_gru(records, ActiveModel(model, 0.1), SHORT, folder)), folder


@pytest.fixture(scope="module")
def stacked(records):
    """Pull, truth and measurement (3, N)."""
    pull, bend = (np.stack(values) for values in zip(*records, strict=True))
    return pull, bend, bend + np.sqrt(0.1) * np.random.default_rng(4).standard_normal(bend.shape)


def untrained(model, hidden=8):
    torch.manual_seed(3)
    return Gru(TorchNetwork(GruNetwork(hidden), hidden), model, 0.1)


def test_it_filters_the_noise_that_it_was_trained_on(trained, stacked):
    pull, bend, measurement = stacked
    error = trained[0].estimate(pull, measurement, bend[:, 0] + 20) - bend
    assert np.sqrt((error[:, 1:] ** 2).mean()) < 0.6 * np.sqrt(0.1)


@pytest.mark.parametrize("chunk", [200_000, 21])
@pytest.mark.parametrize("reference", MODELS, ids=lambda reference: reference.name)
def test_whole_record_equals_sample_by_sample(reference, stacked, chunk, monkeypatch):
    """In one pass and in pieces of seven samples; with a model that has a memory too."""
    monkeypatch.setattr("twin.estimation.learned.scale.CHUNK", chunk)
    pull, _, measurement = stacked
    estimator = untrained(reference)
    whole = estimator.estimate(pull, measurement, 50.0)
    np.testing.assert_allclose(whole, Estimator.estimate(estimator, pull, measurement, 50.0), atol=1e-4)
    assert (whole[:, 0] == 50).all()


def test_batch_along_one_command_equals_one_by_one(trained, stacked):
    estimator, _ = trained
    pull, bend, _ = stacked
    measurement = bend[0] + np.random.default_rng(2).standard_normal((4, bend.shape[1]))
    R = np.array([0.1, 0.5, 1.0, 5.0])
    single = [
        estimator.with_sensor(Sensor(r)).estimate(pull[0], row, 0.0)
        for r, row in zip(R, measurement, strict=True)
    ]
    batch = estimator.with_sensor(Sensor(R)).estimate(pull[0], measurement, 0.0)
    np.testing.assert_allclose(batch, np.concatenate(single), atol=1e-4)


@given(factor=st.floats(0.1, 10), shift=st.floats(-30, 30))
def test_error_scales_with_the_noise_that_it_is_told(trained, stacked, factor, shift):
    """About any response of the model, whatever the angle: the network knows only what is not foretold."""
    estimator, _ = trained
    pull, _, measurement = stacked
    model = estimator.model
    response = model.response(pull, measurement[:, 0])
    moved = model.response(pull, measurement[:, 0] + shift)
    away = estimator.estimate(pull, measurement, 0.0) - response
    told = estimator.with_sensor(Sensor(0.1 * factor**2))
    scaled = told.estimate(pull, moved + factor * (measurement - response), 0.0) - moved
    np.testing.assert_allclose(scaled[:, 1:], factor * away[:, 1:], atol=2e-4 * max(factor, 1))


def test_it_does_not_look_ahead(trained, stacked):
    estimator, _ = trained
    pull, _, measurement = stacked
    changed = measurement.copy()
    changed[:, 120:] += 5.0
    whole, cut = (estimator.estimate(pull, values, 0.0) for values in (measurement, changed))
    np.testing.assert_array_equal(whole[:, :120], cut[:, :120])
    assert not np.allclose(whole[:, 120:], cut[:, 120:])


@pytest.mark.parametrize("reference", MODELS, ids=lambda reference: reference.name)
def test_without_measurements_it_is_the_model(reference, stacked):
    pull, _, measurement = stacked
    alone = untrained(reference).estimate(pull, np.full_like(measurement, np.nan), 40.0)
    np.testing.assert_allclose(alone, reference.response(pull, np.full(3, 40.0)), atol=1e-9)


def test_over_a_gap_the_estimate_follows_the_model_and_then_filters_on(trained, stacked):
    estimator, _ = trained
    pull, bend, measurement = stacked
    holed = measurement.copy()
    holed[1, 60:70] = np.nan
    holed[2, :20] = np.nan  # it begins late
    estimate = estimator.estimate(pull, holed, bend[:, 0] + 20)
    whole = estimator.estimate(pull, measurement, bend[:, 0] + 20)
    assert np.isfinite(estimate).all()
    np.testing.assert_allclose(estimate[0], whole[0], atol=1e-4)  # rows do not touch each other
    along = estimator.model.response(pull[1:2, 59:70], estimate[1:2, 59])
    np.testing.assert_allclose(estimate[1, 59:70], along[0], atol=1e-9)
    error = estimate - bend
    assert np.sqrt((error[1:, 71:] ** 2).mean()) < 0.6 * np.sqrt(0.1)


def test_without_a_measurement_the_network_rests_and_the_last_one_moves_along(trained, stacked):
    """So that the next surprise spans the gap."""
    estimator, _ = trained
    pull, _, measurement = stacked
    state = estimator.start(pull[:, 0], measurement[:, 0])
    missing = np.full(3, np.nan)
    assert not estimator.step(state, pull[:, 1], pull[:, 0], missing).seen.any()
    for k in range(1, 30):
        state = estimator.step(state, pull[:, k], pull[:, k - 1], measurement[:, k])
    rested = state
    for k in range(30, 35):
        rested = estimator.step(rested, pull[:, k], pull[:, k - 1], missing)
    assert np.array_equal(rested.hidden, state.hidden)
    along = estimator.model.response(pull[:, 29:35], measurement[:, 29])
    np.testing.assert_allclose(rested.measurement_deg, along[:, -1], atol=1e-9)


def test_step_leaves_the_state_and_the_measurement_alone(trained, stacked):
    estimator, _ = trained
    pull, _, measurement = stacked
    state = estimator.start(pull[:, 0], measurement[:, 0])
    y = measurement[:, 1].copy()
    first = estimator.step(state, pull[:, 1], pull[:, 0], y)
    y[:] = 1e9  # a stream that fills one buffer again and again
    again = estimator.step(first, pull[:, 2], pull[:, 1], measurement[:, 2])
    np.testing.assert_allclose(
        again.bend_deg, estimator.estimate(pull[:, :3], measurement[:, :3], 0.0)[:, 2], atol=1e-4
    )


def test_saved_network_is_loaded_and_equal(trained, stacked, records, model):
    estimator, folder = trained
    pull, _, measurement = stacked
    expected = estimator.estimate(pull, measurement, 0.0)
    for again in (
        load(train_gru(records, ActiveModel(model, 0.1), SHORT, folder)),
        load(folder / "gru.onnx"),
        pickle.loads(pickle.dumps(estimator)),
    ):
        np.testing.assert_array_equal(again.estimate(pull, measurement, 0.0), expected)
        assert (again.model, again.sample_time) == (model, 0.1)
    assert read_trained_file(folder / "gru.onnx").description["training"]["seed"] == 1


def test_the_exported_graph_is_the_network_that_was_trained():
    """Weights are reordered for ONNX: any number of samples, any batch, memory handed on."""
    torch.manual_seed(2)
    network = GruNetwork(6)
    network.pull_scale.fill_(0.3)
    assert_exported_alike(network, 1)


def test_file_that_is_no_network_is_refused_in_one_line(trained, tmp_path):
    whole = (trained[1] / "gru.onnx").read_bytes()
    path = tmp_path / "gru.onnx"
    with pytest.raises(FileNotFoundError, match="no trained file"):
        load(path)
    for content in (b"nothing", b"", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"is not a trained file written by `endotwin train`") as e:
            load(path)
        assert "\n" not in str(e.value)
    graph = onnx.load(trained[1] / "gru.onnx")
    for change, said in (({"agent": "lstm"}, "holds the agent 'lstm'"), ({"hidden": "8"}, "hidden = ")):
        description = json.loads(graph.metadata_props[0].value) | change
        onnx.helper.set_model_props(graph, {"endotwin": json.dumps(description)})
        onnx.save(graph, path)
        with pytest.raises(ValueError, match=said):
            load(path)
        graph = onnx.load(trained[1] / "gru.onnx")


def test_the_verb_trains_it(tmp_path, model, capsys):
    write_episode(tmp_path / "one.mcap", make_episode(samples=60))
    (tmp_path / "model.json").write_text(json.dumps(model.to_dict()))
    line = f"{tmp_path}/one.mcap --model {tmp_path}/model.json --out {tmp_path}/run --agent gru"
    options = "--sample-time 0.02 --seed 5 --episodes 6 --json"
    assert scripts.train.main([*line.split(), *options.split()]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary == {"out": f"{tmp_path}/run/gru.onnx", "agent": "gru"}
    assert load(tmp_path / "run/gru.onnx").sample_time == 0.02
    assert (tmp_path / "run/progress.csv").read_text().count("\n") == 3
    assert "seed: 5" in (tmp_path / "run/config.yaml").read_text()
