"""Priors of a preset's parameters: distances from their centres, and values within their limits."""

import numpy as np
import pytest
from calibrating import TRUTH
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from twin.calibration.priors import URETEROSCOPE, Prior, decode, encode

DISTANCES = arrays(float, len(URETEROSCOPE), elements=st.floats(-20, 20))


@given(distances=DISTANCES)
def test_what_is_decoded_is_encoded_again_within_its_limits(distances):
    preset = decode(TRUTH, URETEROSCOPE, distances)
    bounds = np.array([prior.bounds for prior in URETEROSCOPE.values()]).T
    np.testing.assert_allclose(encode(preset, URETEROSCOPE), np.clip(distances, *bounds), atol=1e-9)
    for name, prior in URETEROSCOPE.items():
        assert prior.limits[0] <= getattr(preset, name) <= prior.limits[1]


def test_one_deviation_is_a_factor_or_where_zero_is_possible_a_step():
    assert Prior(2.0, 0.5, (1.0, 9.0)).value(1.0) == pytest.approx(2.0 * np.exp(0.5))
    assert Prior(2.0, 0.5, (0.0, 9.0)).value(1.0) == pytest.approx(2.5)
