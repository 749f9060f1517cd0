"""A walk over the ridges between the valleys of a search."""

import threading

import numpy as np
import pytest
from calibrating import loops, start_of

from twin.calibration import free_parameters
from twin.calibration.descent import FARTHEST, TOO_HIGH, parameter_along, walk

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


def test_what_departs_from_the_first_guess_costs_in_the_parameter_walked_along_too(free):
    away, cost = steps(free, 0.1, weight=0.5)  # the residuals here have none for the others
    np.testing.assert_allclose(cost, cost_along(away[:, 0]) + (0.5 * away[:, 0]) ** 2, atol=1e-4)


def test_it_ends_where_the_cost_is_too_high(free):
    away, cost = steps(free, -0.1)
    ended = int(np.argmax(cost > TOO_HIGH * cost_along(0.0)))
    assert 0 < ended < FARTHEST - 1
    np.testing.assert_allclose(away[ended:, 0], -0.1 * (ended + 1))
    assert (cost[ended:] == cost[ended]).all()


def test_it_ends_at_a_limit(free):
    away, cost = steps(free, 100.0)
    assert not away.any()
    assert (cost == cost_along(0.0)).all()


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
