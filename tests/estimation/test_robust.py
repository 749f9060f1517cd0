"""Huber's update against the condition of its minimum, and against what reweighting converges to."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import RobustActiveModel, huber_variance
from twin.estimation.gaussian import Belief

MODEL = COLEMAN_HODGDON
PLAIN = ActiveModel(MODEL, 0.1, measurement_variance=1.0)
ROBUST = RobustActiveModel(**vars(PLAIN))
PULL = 3 + np.sin(2 * np.pi * np.arange(400) * 0.1 / 12)

positive = st.floats(1e-3, 1e3)


def belief_of(spread: np.ndarray) -> Belief:
    covariance = np.array([[2.0, 0.7], [0.7, 1.5]])[:, :, None] * spread
    return Belief(np.stack([np.full(len(spread), 60.0), np.zeros(len(spread))]), covariance, np.empty((0, 1)))


@settings(max_examples=50)
@given(spread=positive, variance=positive, threshold=st.floats(0.1, 10), innovation=st.floats(-50, 50))
def test_update_is_the_minimum_of_a_gaussian_prediction_and_hubers_cost(
    spread, variance, threshold, innovation
):
    robust = dataclasses.replace(ROBUST, measurement_variance=variance, threshold=threshold)
    before = belief_of(np.array([spread]))
    measurement = 60.0 + innovation
    after = robust.update(before, np.array([measurement]))
    pull_of_prediction = np.linalg.solve(before.covariance[:, :, 0], (after.mean - before.mean)[:, 0])
    residual = (measurement - after.mean[0, 0]) / np.sqrt(variance)
    pull_of_measurement = np.clip(residual, -threshold, threshold) / np.sqrt(variance)
    scale = abs(pull_of_measurement) + 1e-9
    np.testing.assert_allclose(
        pull_of_prediction / scale, np.array([pull_of_measurement, 0]) / scale, atol=1e-6
    )


@settings(max_examples=50)
@given(spread=positive, variance=positive, distance=st.floats(0, 50))
def test_inflated_variance_is_the_fixed_point_of_reweighting(spread, variance, distance):
    threshold, inflated = 1.345, variance
    for _ in range(20_000):
        residual = distance * inflated / (spread + inflated)
        previous, inflated = inflated, variance / min(1, threshold * np.sqrt(variance) / max(residual, 1e-12))
        if abs(inflated - previous) <= 1e-12 * inflated:
            break
    found = huber_variance(np.array([distance]), np.array([spread]), np.array(variance), threshold)
    assert found[0] == pytest.approx(inflated, rel=1e-4)


def test_filter_is_the_active_model_where_nothing_exceeds_the_threshold():
    rng = np.random.default_rng(0)
    measurement = MODEL.response(PULL, 60.0) + rng.uniform(-0.8, 0.8, (3, len(PULL)))
    expected = PLAIN.estimate(PULL, measurement, 60.0)
    np.testing.assert_array_equal(ROBUST.estimate(PULL, measurement, 60.0), expected)
    wild = measurement + 30 * (rng.uniform(size=measurement.shape) < 0.1)
    never = dataclasses.replace(ROBUST, threshold=np.inf)
    np.testing.assert_array_equal(never.estimate(PULL, wild, 60.0), PLAIN.estimate(PULL, wild, 60.0))
    assert np.abs(ROBUST.estimate(PULL, wild, 60.0) - PLAIN.estimate(PULL, wild, 60.0)).max() > 0.3


def test_filter_resists_outliers_that_mislead_the_active_model():
    rng = np.random.default_rng(1)
    truth = MODEL.response(PULL, 60.0)
    outliers = rng.choice([0.0, 15.0], p=[0.9, 0.1], size=(20, len(PULL)))
    measurement = truth + rng.normal(size=outliers.shape) + outliers
    error = [np.sqrt(np.mean((f.estimate(PULL, measurement, 60.0) - truth) ** 2)) for f in (ROBUST, PLAIN)]
    assert error[0] < error[1] / 2
