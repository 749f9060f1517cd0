"""Growth of the variances of RAM (twins), the Q of its filters, where it has no measurements."""

import numpy as np
import pytest

from twin.estimation.estimator import Sensor
from twin.estimation.learned.ram_twins import STATE
from twin.estimation.load import load_estimator

T, SAMPLES = 0.1, 600


@pytest.mark.parametrize("name", ["covariance", "rows_covariance"])
@pytest.mark.parametrize("moves", [True, False])
def test_doubt_grows_with_travel_and_time_without_measurements(twins_policy, name, moves):
    """Weights by 0.0005 per mm, d by 0.05 deg^2 per mm less what 5 mm forget, b by a quarter in an hour."""
    ram = load_estimator(twins_policy).with_sensor(Sensor(1.0, zero_deviation_deg=2.0))
    pull = (2.0 * moves * np.sin(np.arange(SAMPLES) * T))[:, None]
    way = np.abs(np.diff(pull[:, 0]))
    state = ram.start(pull[0], np.zeros(1))
    state = ram.step(state, pull[0], pull[0], np.full(1, np.nan))
    first = np.diagonal(state.memory[STATE.index(name)][0])
    for k in range(1, SAMPLES):
        state = ram.step(state, pull[k], pull[k - 1], np.full(1, np.nan))
    last = np.diagonal(state.memory[STATE.index(name)][0])

    np.testing.assert_allclose(last[:-2] - first[:-2], 0.0005 * way.sum(), rtol=1e-3, atol=1e-6)
    in_an_hour = np.sqrt((last[-1] / first[-1] - 1) * 3600 / ((SAMPLES - 1) * T))
    assert in_an_hour == pytest.approx(0.25, abs=0.05)
    if moves:  # the model's error settles where 5 mm forget as much as they add
        assert np.sqrt(last[-2]) == pytest.approx(np.sqrt(0.05 * 5 / 2), rel=0.1)
    else:
        assert np.sqrt(last[-2] - first[-2]) == pytest.approx(0.62, rel=0.02)  # deg in a minute at rest
