import dataclasses

import numpy as np
import pytest
from scipy import stats

from twin.estimation.active_model import ActiveModel
from twin.estimation.tuning import innovation_log_likelihood, tune_active_model
from twin.hysteresis import ColemanHodgdon

AT_REST = ColemanHodgdon(1.0, 1.0, 1.0)  # without motion theta is a random walk plus the integral of f


def simulate(q_bend, q_error, variance, count, samples, rng):
    """Draw angles and measurements from the filter's own model at rest, T = 0.1 s."""
    error = np.cumsum(np.sqrt(q_error) * rng.standard_normal((count, samples)), axis=1)
    steps = np.sqrt(q_bend) * rng.standard_normal((count, samples))
    steps[:, 1:] += 0.1 * error[:, :-1]
    bend = np.cumsum(steps, axis=1)
    return bend, bend + np.sqrt(variance) * rng.standard_normal((count, samples))


def test_likelihood_equals_the_joint_normal_density_of_the_measurements():
    filter_ = ActiveModel(AT_REST, 0.1, (0.02, 0.05), 0.3, (0.7, 0.2))
    samples = 6
    transition = np.array([[1, 0.1], [0, 1]])
    state, covariances = np.diag([0.7, 0.2]), []
    powers = [np.eye(2)]
    for _ in range(samples):
        powers.append(transition @ powers[-1])
        state = transition @ state @ transition.T + np.diag([0.02, 0.05])
        covariances.append(state)
    joint = np.array(
        [
            [(powers[abs(j - i)] @ covariances[min(i, j)])[0, 0] + 0.3 * (i == j) for j in range(samples)]
            for i in range(samples)
        ]
    )
    measurement = np.random.default_rng(0).standard_normal((3, samples + 1))
    expected = stats.multivariate_normal(np.zeros(samples), joint).logpdf(measurement[:, 1:]).sum()
    found = innovation_log_likelihood(filter_, np.zeros_like(measurement), measurement, np.zeros(3))
    assert found == pytest.approx(expected, rel=1e-10)


def test_tuning_recovers_the_variances_that_made_the_data():
    rng = np.random.default_rng(1)
    bend, measurement = simulate(0.05, 0.02, 0.1, 12, 800, rng)
    start = ActiveModel(AT_REST, 0.1, measurement_variance=0.1)
    tuned = tune_active_model(start, np.zeros_like(bend), measurement, bend[:, 0])
    assert tuned.process_variance[0] == pytest.approx(0.05, rel=0.2)
    assert tuned.process_variance[1] == pytest.approx(0.02, rel=0.5)


def test_tuning_does_not_touch_the_noise_and_does_not_lose_likelihood():
    rng = np.random.default_rng(2)
    bend, measurement = simulate(0.5, 0.2, 0.1, 4, 200, rng)
    start = ActiveModel(AT_REST, 0.1, measurement_variance=0.1)
    initial = bend[:, 0] + rng.uniform(-20, 20, 4)
    tuned = tune_active_model(start, np.zeros_like(bend), measurement, initial)
    assert tuned.measurement_variance == start.measurement_variance
    assert dataclasses.replace(
        tuned, process_variance=(1, 1), initial_variance=(1, 1)
    ) == dataclasses.replace(start, process_variance=(1, 1), initial_variance=(1, 1))
    data = (np.zeros_like(bend), measurement, initial)
    assert innovation_log_likelihood(tuned, *data) > innovation_log_likelihood(start, *data) + 100
