import pickle

import numpy as np
import pytest
import torch
from exported import assert_exported_alike

from rl.lstm import LstmNetwork, train_lstm
from rl.supervised import SequenceTraining
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator
from twin.estimation.learned.lstm import increments, load

SHORT = SequenceTraining(iterations=150, sequences=32, window=100, seed=1)


@pytest.fixture(scope="module")
def trained(records, model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lstm")
    return load(train_lstm(records, ActiveModel(model, 0.1), SHORT, folder)), folder


def test_it_filters_the_noise_that_it_was_trained_on(trained, records):
    estimator, _ = trained
    pull, bend = records[1]
    noise = np.sqrt(0.1) * np.random.default_rng(9).standard_normal((20, len(bend)))
    error = estimator.estimate(pull, bend + noise, bend[0]) - bend
    assert np.sqrt((error[:, 10:] ** 2).mean()) < 0.75 * np.sqrt(0.1)


def test_its_estimate_does_not_depend_on_the_stroke(trained, records):
    """It sees increments: shifting angle and pull by a constant shifts the estimate by the same."""
    estimator, _ = trained
    pull, bend = records[0]
    shifted = estimator.estimate(pull - 3.0, (bend - 60.0)[None], -60.0)
    np.testing.assert_allclose(shifted, estimator.estimate(pull, bend[None], 0.0) - 60.0, atol=1e-3)


def test_it_does_not_look_ahead(trained, records):
    estimator, _ = trained
    pull, bend = records[0]
    changed = bend.copy()
    changed[120:] += 5.0
    whole, cut = (estimator.estimate(pull, values[None], 0.0) for values in (bend, changed))
    np.testing.assert_array_equal(whole[:, :120], cut[:, :120])
    assert not np.allclose(whole[:, 120:], cut[:, 120:])


def test_batch_equals_one_by_one(trained, records):
    estimator, _ = trained
    pull, bend = records[0]
    measurement = bend + np.random.default_rng(2).standard_normal((3, len(bend)))
    single = np.concatenate([estimator.estimate(pull, row[None], 0.0) for row in measurement])
    np.testing.assert_allclose(estimator.estimate(pull, measurement, 0.0), single, atol=1e-4)


def test_finished_run_is_loaded_and_equal(trained, records, model):
    _, folder = trained
    before = (folder / "lstm.onnx").stat().st_mtime_ns
    assert train_lstm(records, ActiveModel(model, 0.1), SHORT, folder) == folder / "lstm.onnx"
    assert (folder / "lstm.onnx").stat().st_mtime_ns == before


def test_the_exported_graph_is_the_network_that_was_trained():
    """Weights are reordered for ONNX: any number of samples, any batch, memory handed on."""
    torch.manual_seed(2)
    network = LstmNetwork(6)
    network.input_scale.copy_(torch.tensor([0.3, 2.0]))
    assert_exported_alike(network, 2)


def test_file_that_is_no_network_is_refused(tmp_path):
    path = tmp_path / "lstm.onnx"
    path.write_bytes(b"nothing")
    with pytest.raises(ValueError, match="not a trained file written by"):
        load(path)


@pytest.fixture(scope="module")
def filtered(trained, records):
    """The filter, and three noisy records along their own commands: pull, measurement (3, N)."""
    pull, bend = (np.stack(values) for values in zip(*records, strict=True))
    measurement = bend + np.sqrt(0.1) * np.random.default_rng(4).standard_normal(bend.shape)
    return trained[0], pull, measurement


@pytest.mark.parametrize("chunk", [200_000, 21])
def test_whole_record_equals_sample_by_sample(filtered, chunk, monkeypatch):
    """Both in one pass and in pieces of seven samples."""
    monkeypatch.setattr("twin.estimation.learned.scale.CHUNK", chunk)
    estimator, pull, measurement = filtered
    whole = estimator.estimate(pull, measurement, 50.0)
    online = Estimator.estimate(estimator, pull, measurement, 50.0)
    np.testing.assert_allclose(whole, online, atol=1e-4)
    assert (whole[:, 0] == 50).all()


def test_estimator_is_the_network_from_the_second_sample_on(filtered):
    """The first measurement is no estimator's to use; the initial estimate is not the network's."""
    estimator, pull, measurement = filtered
    seen = increments(pull[:, 1:].T, measurement[:, 1:].T)
    nothing = np.zeros((2, len(pull), estimator.network.hidden), np.float32)
    noise, _ = estimator.network(seen, nothing)
    expected = measurement[:, 1:] - noise.T
    np.testing.assert_allclose(estimator.estimate(pull, measurement, 0.0)[:, 1:], expected, atol=1e-4)


def test_missing_samples_are_skipped_as_if_they_had_not_been(filtered):
    estimator, pull, measurement = filtered
    gone = np.random.default_rng(7).random(pull.shape[1]) < 0.3
    gone[[0, 50, 51, 52]] = [False, True, True, True]
    holed = np.where(gone, np.nan, measurement)
    estimate = estimator.estimate(pull, holed, 50.0)
    dense = estimator.estimate(pull[:, ~gone], measurement[:, ~gone], 50.0)
    np.testing.assert_allclose(estimate[:, ~gone], dense, atol=1e-4)
    np.testing.assert_array_equal(estimate[:, 50:53], estimate[:, [49, 49, 49]])
    nothing = estimator.estimate(pull, np.full_like(measurement, np.nan), 50.0)
    np.testing.assert_array_equal(nothing, np.full_like(measurement, 50.0))


def test_pickled_estimator_estimates_the_same(filtered):
    estimator, pull, measurement = filtered
    again = pickle.loads(pickle.dumps(estimator))
    np.testing.assert_array_equal(
        again.estimate(pull, measurement, 0.0), estimator.estimate(pull, measurement, 0.0)
    )
    assert again.sample_time == estimator.sample_time == 0.1
