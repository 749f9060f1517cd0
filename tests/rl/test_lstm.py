import pickle

import numpy as np
import pytest
import torch

from rl.lstm import Lstm, LstmEstimator, load_lstm, train_lstm
from rl.supervised import SequenceTraining
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator

SHORT = SequenceTraining(iterations=150, sequences=32, window=100, seed=1)


@pytest.fixture(scope="module")
def trained(records, model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lstm")
    return train_lstm(records, ActiveModel(model, 0.1), SHORT, folder), folder


def test_it_filters_the_noise_that_it_was_trained_on(trained, records):
    network, _ = trained
    pull, bend = records[1]
    noise = np.sqrt(0.1) * np.random.default_rng(9).standard_normal((20, len(bend)))
    error = network.estimate(pull, bend + noise) - bend
    assert np.sqrt((error[:, 10:] ** 2).mean()) < 0.75 * np.sqrt(0.1)


def test_its_estimate_does_not_depend_on_the_stroke(trained, records):
    """It sees increments: shifting angle and pull by a constant shifts the estimate by the same."""
    network, _ = trained
    pull, bend = records[0]
    shifted = network.estimate(pull - 3.0, (bend - 60.0)[None])
    np.testing.assert_allclose(shifted, network.estimate(pull, bend[None]) - 60.0, atol=1e-3)


def test_it_does_not_look_ahead(trained, records):
    network, _ = trained
    pull, bend = records[0]
    changed = bend.copy()
    changed[120:] += 5.0
    whole, cut = network.estimate(pull, bend[None]), network.estimate(pull, changed[None])
    np.testing.assert_array_equal(whole[:, :120], cut[:, :120])
    assert not np.allclose(whole[:, 120:], cut[:, 120:])


def test_batch_equals_one_by_one(trained, records):
    network, _ = trained
    pull, bend = records[0]
    measurement = bend + np.random.default_rng(2).standard_normal((3, len(bend)))
    single = np.concatenate([network.estimate(pull, row[None]) for row in measurement])
    np.testing.assert_allclose(network.estimate(pull, measurement), single, atol=1e-4)


def test_finished_run_is_loaded_and_equal(trained, records, model):
    network, folder = trained
    again = train_lstm(records, ActiveModel(model, 0.1), SHORT, folder)
    for name, value in network.state_dict().items():
        assert torch.equal(value, again.state_dict()[name])


def test_file_that_is_no_network_is_refused(tmp_path):
    path = tmp_path / "lstm.pt"
    path.write_bytes(b"nothing")
    with pytest.raises(ValueError, match="not an LSTM of 32 units"):
        load_lstm(path)
    torch.save(Lstm(8).state_dict(), path)
    with pytest.raises(ValueError, match="not an LSTM of 32 units"):
        load_lstm(path, 32)


@pytest.fixture(scope="module")
def filtered(trained, records):
    """The filter, and three noisy records along their own commands: pull, measurement (3, N)."""
    pull, bend = (np.stack(values) for values in zip(*records, strict=True))
    measurement = bend + np.sqrt(0.1) * np.random.default_rng(4).standard_normal(bend.shape)
    return LstmEstimator(trained[0]), pull, measurement


@pytest.mark.parametrize("chunk", [200_000, 21])
def test_whole_record_equals_sample_by_sample(filtered, chunk, monkeypatch):
    """Both in one pass and in pieces of seven samples."""
    monkeypatch.setattr("rl.supervised.CHUNK", chunk)
    estimator, pull, measurement = filtered
    whole = estimator.estimate(pull, measurement, 50.0)
    online = Estimator.estimate(estimator, pull, measurement, 50.0)
    np.testing.assert_allclose(whole, online, atol=1e-4)
    assert (whole[:, 0] == 50).all()


def test_estimator_is_the_network_from_the_second_sample_on(filtered):
    """The first measurement is no estimator's to use; the initial estimate is not the network's."""
    estimator, pull, measurement = filtered
    alone = estimator.network.estimate(pull[:, 1:], measurement[:, 1:])
    np.testing.assert_allclose(estimator.estimate(pull, measurement, 0.0)[:, 1:], alone, atol=1e-4)


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
    assert again.network.sample_time == estimator.network.sample_time == 0.1
