"""Uncertainty of calibrated parameters, and warnings about what the logs do not determine."""

import dataclasses

import numpy as np
import pytest
from calibrating import loops, start_of

from twin.calibration import Fit, calibrate, free_parameters, likely_ranges, uncertainty


def test_ranges_of_a_fit_hold_it_and_are_wide_where_the_logs_tell_nothing(fitted):
    free, _, fit, _ = fitted
    known = uncertainty(fit)
    for name, low, high in likely_ranges(fit, known).limits:
        assert low < getattr(fit.preset, name) < high
        assert high / low < 1.2
    blind = dataclasses.replace(known, deviation=dict.fromkeys(free.names, np.inf))
    for name, low, high in likely_ranges(fit, blind).limits:
        assert high / low == pytest.approx(9, rel=1e-3), name


def test_parameter_that_the_logs_do_not_feel_is_named():
    logs = loops(0.0)  # a straight sheath: the coefficient of friction has nothing to act on
    free = free_parameters(start_of(sheath_bend=0.0), logs, ("section_stiffness", "sheath_friction"))
    known = uncertainty(calibrate([free], logs, seed=0, starts=2))
    assert any(warning.startswith("sheath_friction: the logs do not depend") for warning in known.warnings)
    assert not any("section_stiffness" in warning for warning in known.warnings)
    assert np.isinf(known.deviation["sheath_friction"])


@pytest.fixture
def straight():
    """A fit of two parameters whose residuals are linear, with noise of deviation 0.1."""
    free = free_parameters(start_of(), loops(0.0), ("section_stiffness", "wire_offset"))
    rng = np.random.default_rng(2)
    jacobian = rng.standard_normal((400, 2))
    return Fit(free, free.base, 1.0, 1.0, jacobian, 0.1 * rng.standard_normal(400))


def deviations(fit):
    """Return the standard deviations on the scale of the search, (P,)."""
    known = uncertainty(fit).deviation
    return np.array([known[name] / getattr(fit.preset, name) for name in fit.free.names])


@pytest.mark.parametrize("rise", [0.0, 0.02])
def test_a_valley_that_fits_as_well_counts_by_its_likelihood(straight, rise):
    away = np.array([0.5, -0.2])
    other = np.concatenate([[rise], away])[None]
    share = np.exp(-rise / 0.02)  # of a variance of 0.01
    wide = deviations(dataclasses.replace(straight, neighbours=other)) ** 2
    expected = deviations(straight) ** 2 + away**2 * share / (1 + share)
    np.testing.assert_allclose(wide, expected, rtol=0.1)
