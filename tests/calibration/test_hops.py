"""Points of a hop: spread as the fit is uncertain, at every width, and within all limits."""

import numpy as np
import pytest

from twin.calibration.hops import EACH, FARTHEST, WIDTHS, points_about


def test_points_spread_by_the_uncertainty_of_each_axis_at_each_width():
    slope = np.diag([1e4, 1e3])
    rng = np.random.default_rng(0)
    drawn = [
        points_about(np.ones(2), slope, 0.25, (np.full(2, -9.0), np.full(2, 9.0)), rng) for _ in range(400)
    ]
    spread = np.concatenate(drawn, axis=1).std(axis=1)
    assert drawn[0].shape == (len(WIDTHS), EACH, 2)
    np.testing.assert_allclose(spread, np.outer(WIDTHS, [0.5e-4, 0.5e-3]), rtol=0.05)


def test_an_axis_that_nothing_tells_is_searched_no_farther_than_allowed():
    slope = np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    bounds = (np.array([0.9, -3.0, -3.0]), np.full(3, 3.0))
    points = points_about(np.ones(3), slope, 0.01, bounds, np.random.default_rng(1))
    assert np.isfinite(points).all()
    assert np.abs(points - 1).max() == pytest.approx(FARTHEST)
    assert points[..., 0].min() >= 0.9
