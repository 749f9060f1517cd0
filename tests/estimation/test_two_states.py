"""The active model and RAM on plain numbers: the same as on arrays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import BOUC_WEN, COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import RobustActiveModel
from twin.estimation.two_states import TwoStatesForm

PLAIN = ActiveModel(COLEMAN_HODGDON, 0.1, (1e-3, 4e-2), 0.5, (25.0, 1.0))
variance = st.floats(1e-6, 1e4)


def batch(estimator, pull, measurement):
    """Estimates of two equal records: a single one would take the plain form itself."""
    return estimator.estimate(np.stack([pull, pull]), np.stack([measurement, measurement]), 50.0)[0]


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000), variance, variance, variance, variance, variance)
def test_plain_numbers_filter_as_arrays_do(seed, q, e, r, p, f):
    rng = np.random.default_rng(seed)
    pull = np.cumsum(rng.normal(0, 0.1, 60))
    measurement = np.where(rng.random(60) < 0.2, np.nan, rng.normal(40, 30, 60))
    estimator = ActiveModel(COLEMAN_HODGDON, 0.1, (q, e), r, (p, f))
    plain = estimator.estimate(pull, measurement, 50.0)[0]
    np.testing.assert_allclose(plain, batch(estimator, pull, measurement), rtol=1e-7, atol=1e-7)


def test_other_filters_and_models_have_no_plain_form():
    assert isinstance(PLAIN.single(), TwoStatesForm)
    assert not RobustActiveModel(**vars(PLAIN)).single().plain
    assert not ActiveModel(BOUC_WEN, 0.1).single().plain


@pytest.mark.parametrize("number", range(6))
def test_a_state_with_one_impossible_number_is_not_sound(number):
    form = PLAIN.single()
    state = form.step(form.start(3.0, 60.0), 3.1, 3.0, 61.0)
    assert form.is_sound(state)
    for wrong in (np.nan, np.inf, -1e13):
        assert not form.is_sound(state._replace(**{state._fields[number]: wrong}))
