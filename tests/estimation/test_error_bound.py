"""Bounds of the error of a model: recovered from records that exhaust them, and none smaller holds."""

import numpy as np
import pytest
from bounded_system import COLEMAN_HODGDON, pulls, simulate

from twin.estimation.set_membership import ErrorBound, bound_model_error


def training_records(bound: ErrorBound, style: str = "even"):
    rng = np.random.default_rng(6)
    pull = pulls(rng, 5, 400)
    pull[:, 1] = pull[:, 0]  # a record may begin at rest
    return list(zip(pull, simulate(COLEMAN_HODGDON, bound, pull, rng, style), strict=True))


@pytest.mark.parametrize("bound", [ErrorBound(8.0, 0.05), ErrorBound(0.0, 0.3), ErrorBound(4.0, 0.0)])
def test_bounds_are_recovered_from_records_that_exhaust_them(bound):
    found = bound_model_error(COLEMAN_HODGDON, training_records(bound, "ends"), factor=1.0)
    assert found.slope_deg_per_mm == pytest.approx(bound.slope_deg_per_mm, rel=1e-6, abs=1e-6)
    assert found.floor_deg == pytest.approx(bound.floor_deg, rel=1e-6, abs=1e-6)


def test_bounds_hold_on_their_records_and_no_smaller_mean_does():
    records = training_records(ErrorBound(8.0, 0.05))
    found = bound_model_error(COLEMAN_HODGDON, records, factor=1.0)
    move = np.concatenate([np.abs(np.diff(pull)) for pull, _ in records])
    error = np.concatenate(
        [
            np.abs(bend[1:] - COLEMAN_HODGDON.step(bend[:-1], np.empty((0, 1)), pull[1:], pull[:-1])[0])
            for pull, bend in records
        ]
    )
    assert (error <= found.slope_deg_per_mm * move + found.floor_deg).all()
    mean = found.slope_deg_per_mm * move.mean() + found.floor_deg
    for slope in np.linspace(0, 20, 400):
        floor = max((error - slope * move).max(), 0)
        assert slope * move.mean() + floor >= mean - 1e-9


def test_wrong_bounds_are_refused():
    with pytest.raises(ValueError, match="none negative"):
        ErrorBound(-1.0, 0.1)
    with pytest.raises(ValueError, match=r"factor 0\.5"):
        bound_model_error(COLEMAN_HODGDON, training_records(ErrorBound(1.0, 0.1)), factor=0.5)
    with pytest.raises(ValueError, match="two samples"):
        bound_model_error(COLEMAN_HODGDON, [(np.ones(1), np.ones(1))])
