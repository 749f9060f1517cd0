"""Descent: straight coordinates, secants, and a walk over the ridges between valleys."""

import threading

import numpy as np
import pytest
from calibrating import TRUTH, loops, start_of
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from twin.calibration import free_parameters
from twin.calibration.descent import (
    FARTHEST,
    LONGEST,
    SHORTEST,
    TOO_HIGH,
    Valley,
    parameter_along,
    secants,
    variance_of,
    walk,
)
from twin.calibration.parameters import FreeParameters

NAMES = ("section_stiffness", "wire_stiffening", "pretension", "wire_stiffness")
BASE = TRUTH.replace(wire_stiffening=0.2)
POINTS = arrays(float, 4, elements=st.floats(-3, 3))


@given(point=POINTS)
def test_slopes_are_those_of_the_straight_coordinates(point):
    valley = Valley(FreeParameters(BASE, NAMES))

    def residual(numbers):
        return np.array([np.sin(numbers).sum(), numbers @ numbers, numbers[1] * numbers[3]])

    def jacobian(numbers):
        return np.array([np.cos(numbers), 2 * numbers, [0, numbers[3], 0, numbers[1]]])

    straight, step = valley.straight(point), 1e-6
    differences = [
        (residual(valley.point(straight + e)) - residual(valley.point(straight - e))) / (2 * step)
        for e in step * np.eye(4)
    ]
    np.testing.assert_allclose(
        valley.slope(jacobian(point), point), np.array(differences).T, rtol=1e-5, atol=1e-5
    )


def test_stiffness_at_the_pretension_stays_along_it():
    free = FreeParameters(BASE, NAMES)
    valley = Valley(free)
    begin = valley.straight(free.start)

    def at_work(preset):
        return preset.wire_stiffness * np.sqrt(1 + 2 * preset.wire_stiffening * preset.pretension)

    moved = begin + np.array([0.0, 0.7, -0.4, 0.0])
    assert at_work(free.decode(valley.point(moved))) == pytest.approx(at_work(BASE))


FREE = (np.full(3, -np.inf), np.full(3, np.inf))


@given(seed=st.integers(0, 1000), variance=st.floats(0, 10))
def test_linear_residuals_have_their_own_derivative(seed, variance):
    rng = np.random.default_rng(seed)
    slope, about = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    points = lambda ends: np.array(ends) @ slope.T + 1.0  # noqa: E731
    found = secants(points, rng.normal(size=3), about, variance, FREE)
    np.testing.assert_allclose(found, slope, atol=1e-9)


def test_a_kink_within_the_reach_counts_by_half_and_one_beyond_not_at_all():
    def residuals(points):
        return np.array([[abs(x) + x, 3 * y] for x, y in points])

    about = np.eye(2)
    bounds = (np.full(2, -10.0), np.full(2, 10.0))
    wide = secants(residuals, np.zeros(2), about, 0.05**2, bounds)
    np.testing.assert_allclose(wide, [[1, 0], [0, 3]], atol=1e-12)
    beyond = secants(residuals, np.array([0.06, 0.0]), about, 0.05**2, bounds)
    np.testing.assert_allclose(beyond, [[2, 0], [0, 3]], atol=1e-12)


def test_reach_is_a_standard_deviation_within_its_limits_and_the_bounds():
    seen = []

    def residuals(points):
        seen.append(np.array(points))
        return np.array(points)

    around = np.diag([1e6, 20.0, 1e-6])  # known far too well, within 0.05, and not at all
    bounds = (np.full(3, -0.1), np.full(3, 1.0))
    secants(residuals, np.zeros(3), around, 1.0, bounds)
    above, below = seen[0][:3], seen[0][3:]
    assert sorted(np.abs(above - below).max(axis=1)) == pytest.approx([2 * SHORTEST, 0.1, 0.1 + LONGEST])
    assert (below >= -0.1).all()


def test_variance_of_noise_is_its_own_and_of_correlated_noise_counts_the_fewer_samples():
    rng = np.random.default_rng(0)
    noise = 0.3 * rng.standard_normal(100_000)
    assert variance_of(noise, 5) == pytest.approx(0.09, rel=0.05)
    r, series = 0.8, np.empty(100_000)
    series[0] = noise[0]
    for k in range(1, len(series)):
        series[k] = r * series[k - 1] + noise[k]
    assert variance_of(series, 5) == pytest.approx(np.var(series) * (1 + r) / (1 - r), rel=0.1)
    assert variance_of(np.zeros(9), 3) == 0


NAME = "joint_friction_taper"


def cost_along(x):
    """Return the cost over the parameter walked along: valleys at even tenths, the lowest at 0.4."""
    return 1 + 0.2 * np.sin(np.pi * x / 0.2) ** 2 + (x - 0.4) ** 2


@pytest.fixture
def free(monkeypatch):
    """Three parameters; the residuals of the last two are zero on a curve over the first."""
    free = free_parameters(start_of(), loops(0.0), (NAME, "wire_stiffness", "wire_offset"))

    def penalised(rest, points, *args, **options):
        x = (free.encode(rest.base) - free.start)[0]
        y, z = (np.array(points) - free.start[1:]).T
        along = np.full(len(points), np.sqrt(cost_along(x)))
        return np.stack([along, 30 * (y - x**2), 30 * (z + 0.5 * x)], axis=1)

    monkeypatch.setattr("twin.calibration.descent.penalised", penalised)
    return free


def steps(free, stride, weight=0.0):
    """Return the distances (FARTHEST, P) from the start of the points that a walk meets, and their costs."""
    begin = free.start
    options = {"steps": 30, "weight": weight, "threads": 1, "stopped": threading.Event()}
    met = walk(free, [], cost_along(0.0), begin, NAME, stride, **options)
    return met[:, 1:] - begin, met[:, 0]


def test_a_walk_crosses_ridges_and_the_others_follow(free):
    away, cost = steps(free, 0.1)
    x = 0.1 * np.arange(1, FARTHEST + 1)
    np.testing.assert_allclose(away, np.stack([x, x**2, -0.5 * x], axis=1), atol=1e-4)
    np.testing.assert_allclose(cost, cost_along(x), atol=1e-4)
    assert cost[0] > cost_along(0.0) > cost[3] == cost.min()


def test_it_ends_where_the_cost_is_too_high(free):
    away, cost = steps(free, -0.1)
    ended = int(np.argmax(cost > TOO_HIGH * cost_along(0.0)))
    assert 0 < ended < FARTHEST - 1
    np.testing.assert_allclose(away[ended:, 0], -0.1 * (ended + 1))
    assert (cost[ended:] == cost[ended]).all()


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (("wire_offset", "section_stiffness", NAME), NAME),
        (("joint_friction", "section_stiffness"), "section_stiffness"),
        (("wire_offset", "wire_stiffness"), None),
        (("section_stiffness",), None),
    ],
)
def test_the_parameter_that_orders_the_hinges_is_walked_along(names, chosen):
    assert parameter_along(free_parameters(start_of(), loops(0.0), names)) == chosen
