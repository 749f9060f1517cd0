"""Ellipsoids that hold sets: no point is lost, and none smaller is found by search."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from twin.estimation.set_membership import Ellipsoid, add_segment, around_box, cut

sizes = st.floats(1e-3, 1e3)
shapes = st.tuples(sizes, sizes, st.floats(-0.999, 0.999))
axes = st.integers(0, 1)


def ellipsoid(first: float, second: float, correlation: float, centre=(0.0, 0.0)) -> Ellipsoid:
    cross = correlation * first * second
    shape = np.array([[first**2, cross], [cross, second**2]])
    return Ellipsoid(np.array(centre)[:, None], shape[..., None])


def grid(held: Ellipsoid) -> np.ndarray:
    """(2, M) points all over one ellipsoid, its edge included."""
    radius, angle = np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 2 * np.pi, 120))
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)]).reshape(2, -1)
    return held.centre + np.linalg.cholesky(held.shape[..., 0]) @ disc


def level(held: Ellipsoid, points: np.ndarray) -> np.ndarray:
    """(x - c)^T P^-1 (x - c) of points (2, M)."""
    off = points - held.centre
    return np.einsum("im,ij,jm->m", off, np.linalg.inv(held.shape[..., 0]), off)


def area(held: Ellipsoid) -> float:
    return float(np.sqrt(np.linalg.det(held.shape[..., 0])))


@given(shape=shapes, axis=axes, length=st.floats(0, 1e3))
def test_sums_with_a_segment_stay_inside(shape, axis, length):
    held = ellipsoid(*shape, (3.0, -1.0))
    grown = add_segment(held, axis, length)
    for share in (-1, -0.3, 1):
        points = grid(held)
        points[axis] += share * length
        assert level(grown, points).max() < 1 + 1e-6


@given(shape=shapes, axis=axes, share=st.floats(0.01, 100))
def test_no_sum_of_the_family_is_smaller(shape, axis, share):
    held = ellipsoid(*shape)
    length = share * shape[axis]
    segment = np.zeros((2, 2))
    segment[axis, axis] = length**2

    def logarithm(log_p):
        p = np.exp(log_p)
        return np.log(np.linalg.det((1 + 1 / p) * held.shape[..., 0] + (1 + p) * segment)) / 2

    least = minimize_scalar(logarithm, bounds=(-12, 12), method="bounded", options={"xatol": 1e-9}).fun
    assert np.log(area(add_segment(held, axis, length))) == pytest.approx(least, abs=1e-6)


@given(shape=shapes, axis=axes, low=st.floats(-1.5, 1.4), width=st.floats(0.01, 3))
def test_what_lies_between_the_bounds_stays_inside(shape, axis, low, width):
    held = ellipsoid(*shape, (3.0, -1.0))
    low, high = held.centre[axis] + shape[axis] * low, held.centre[axis] + shape[axis] * (low + width)
    kept, empty = cut(held, axis, low, high)
    points = grid(held)
    points = points[:, (points[axis] >= low) & (points[axis] <= high)]
    if points.size:
        assert not empty[0]
        assert level(kept, points).max() < 1 + 1e-6
    assert area(kept) <= area(held) * (1 + 1e-8)


@given(shape=shapes, axis=axes, low=st.floats(-1.2, 0.9), width=st.floats(0.02, 2))
def test_no_cut_of_the_family_is_smaller(shape, axis, low, width):
    """The family (x - c)^T P^-1 (x - c) + w (x_axis - m)^2 / d^2 <= 1 + w, with its square completed."""
    held = ellipsoid(*shape)
    ends = np.clip([low, low + width], -1, 1) * shape[axis]
    if ends[1] - ends[0] < 1e-3 * shape[axis]:
        return
    middle, half = ends.mean(), (ends[1] - ends[0]) / 2
    inverse, normal = np.linalg.inv(held.shape[..., 0]), np.eye(2)[axis]

    def logarithm(log_w):
        w = np.exp(log_w) if log_w > -40 else 0.0
        matrix = inverse + w / half**2 * np.outer(normal, normal)
        linear = w / half**2 * middle * normal
        level = 1 + w - w / half**2 * middle**2 + linear @ np.linalg.solve(matrix, linear)
        return np.log(level) - np.linalg.slogdet(matrix)[1] / 2

    options = {"xatol": 1e-9}
    least = minimize_scalar(logarithm, bounds=(-15, 25), method="bounded", options=options).fun
    kept, _ = cut(held, axis, ends[:1], ends[1:])
    assert np.log(area(kept)) == pytest.approx(min(least, logarithm(-50.0)), abs=1e-6)


@given(shape=shapes, axis=axes)
def test_bounds_around_the_ellipsoid_leave_it_and_bounds_outside_leave_nothing(shape, axis):
    held = ellipsoid(*shape, (3.0, -1.0))
    for low, high in ((-1.0, 1.0), (-2.0, 5.0), (-np.inf, np.inf)):
        kept, empty = cut(
            held, axis, held.centre[axis] + low * shape[axis], held.centre[axis] + high * shape[axis]
        )
        assert not empty[0]
        np.testing.assert_allclose(kept.centre, held.centre, rtol=1e-6, atol=1e-6 * max(shape[:2]))
        np.testing.assert_allclose(kept.shape, held.shape, rtol=1e-6)
    for low, high in ((1.01, 3.0), (-np.inf, -1.01)):
        kept, empty = cut(
            held, axis, held.centre[axis] + low * shape[axis], held.centre[axis] + high * shape[axis]
        )
        assert empty[0]
        np.testing.assert_allclose(kept.shape, held.shape, rtol=1e-8)


@given(first=sizes, second=sizes)
def test_ellipsoid_around_a_box_passes_through_its_corners(first, second):
    low = np.array([[1.0], [2.0]])
    high = low + np.array([[first], [second]])
    around = around_box(low, high)
    corners = np.array([[x, y] for x in (low[0, 0], high[0, 0]) for y in (low[1, 0], high[1, 0])]).T
    np.testing.assert_allclose(level(around, corners), 1, rtol=1e-6)
    # The smallest ellipse around a rectangle has pi / 2 of its area.
    assert area(around) * np.pi == pytest.approx(np.pi / 2 * first * second, rel=1e-6)
