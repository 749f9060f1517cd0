"""Uncertainty of calibrated parameters, and the words on what the logs do not tell."""

import dataclasses

import numpy as np
import pytest
from calibrating import loops, start_of

from twin.calibration import calibrate, free_parameters, likely_ranges, uncertainty


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
