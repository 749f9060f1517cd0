"""Straight coordinates of a search: they go back to where they came from; slopes follow the chain rule."""

import numpy as np
import pytest
from calibrating import TRUTH
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from twin.calibration.descent import Valley
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


@given(straight=arrays(float, 4, elements=st.floats(-40, 40)))
def test_a_point_of_the_valley_is_taken_within_its_limits(straight):
    free = FreeParameters(BASE, NAMES)
    valley = Valley(free)
    within = valley.within(straight)
    assert (free.lower <= within).all()
    assert (within <= free.upper).all()
    np.testing.assert_array_equal(valley.within(valley.straight(free.start)), free.start)


def test_only_the_stiffness_that_is_replaced_has_no_bounds():
    free = FreeParameters(BASE, NAMES)
    lower, upper = Valley(free).bounds()
    assert (lower[3], upper[3]) == (-np.inf, np.inf)
    np.testing.assert_array_equal(lower[:3], free.lower[:3])
    np.testing.assert_array_equal(upper[:3], free.upper[:3])
    plain = FreeParameters(BASE, NAMES[2:])
    np.testing.assert_array_equal(Valley(plain).bounds(), (plain.lower, plain.upper))
