"""Bouc-Wen: known parameters come back, from where no direction leads further down."""

import numpy as np
import pytest
from identifying import SEEDS, noisy_records, parameters_of

from twin.hysteresis import BoucWen
from twin.identification import identify, mean_square_error


@pytest.mark.parametrize("seed", SEEDS)
def test_bouc_wen_comes_back_from_noisy_signals_within_two_percent(seed):
    """Ten records: from five, sigma has a standard error of 1 % at best (Cramer and Rao)."""
    known = BoucWen(22.0, -15.0, 1.7, 0.9, 1.5)
    records = noisy_records(known, seed, each=2)
    model, rmse = identify(records, seed, "bouc-wen", population=24, generations=12)
    np.testing.assert_allclose(parameters_of(model), parameters_of(known), rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(0.1), rel=0.05)


def test_bouc_wen_ends_where_no_direction_leads_further_down():
    """The gradient of the mean square error vanishes, by differences of its own."""
    records = noisy_records(BoucWen(20.0, 9.0, 2.5, 1.2, 2.0), 4)  # leads instead of lagging
    model, rmse = identify(records, 0, "bouc-wen", population=24, generations=12)
    best = parameters_of(model)
    assert rmse**2 == pytest.approx(mean_square_error(model, records))
    for i in range(5):
        ends = []
        for way in (1, -1):
            near = best.copy()
            near[i] *= 1 + way * 1e-3
            ends.append(float(mean_square_error(BoucWen(*near), records)))
        assert min(ends) > rmse**2
        assert abs(ends[0] - ends[1]) < 0.1 * (sum(ends) / 2 - rmse**2)
