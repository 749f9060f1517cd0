"""Bouc-Wen: known parameters come back, from where no direction leads further down."""

import numpy as np
import pytest
from identifying import SEEDS, noisy_records, parameters_of

from twin.hysteresis import BoucWen
from twin.identification import identify


@pytest.mark.parametrize("seed", SEEDS)
def test_bouc_wen_comes_back_from_noisy_signals_within_two_percent(seed):
    """Ten records: from five, sigma has a standard error of 1 % at best (Cramer and Rao)."""
    known = BoucWen(22.0, -15.0, 1.7, 0.9, 1.5)
    records = noisy_records(known, seed, each=2)
    model, rmse = identify(records, seed, "bouc-wen", population=24, generations=12)
    np.testing.assert_allclose(parameters_of(model), parameters_of(known), rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(0.1), rel=0.05)
