"""Law of two neighbours that rub as one, its derivatives, and the linear system that it is part of."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.mechanics.kernels import COMPILED
from twin.reduced import two_planes
from twin.reduced.two_planes import (
    FRICTION,
    HELD_FORCE,
    MISSING,
    OF_FORCE,
    OF_FRICTION,
    OF_SLIP,
    SLIPPED,
    STIFFNESS,
)


def called_by_python(kernel):
    """A function that calls a kernel: Python cannot, where kernels are compiled."""
    if not COMPILED:
        return kernel
    import numba

    return numba.njit(lambda *arguments: kernel(*arguments))


come_to_rest, eliminate, rub = map(
    called_by_python, (two_planes.come_to_rest, two_planes.eliminate, two_planes.rub)
)

FORCES = st.floats(-5.0, 5.0)
FRICTIONS = st.floats(0.05, 3.0)


def neighbours(force, friction, slipped, stiffness=(3e4, 5e4)) -> np.ndarray:
    """Rows of two neighbours."""
    pair = np.zeros((11, 2))
    pair[[HELD_FORCE, FRICTION, SLIPPED, STIFFNESS]] = force, friction, slipped, stiffness
    return pair


@given(friction=st.tuples(FRICTIONS, FRICTIONS), angle=st.floats(-np.pi, np.pi), travel=st.floats(1e-6, 1e-3))
def test_nothing_is_missing_where_friction_opposes_the_slip_as_one(friction, angle, travel):
    """Least elastic energy and dissipation |F dx|: t = F (F dx) / |F dx|, for a slip in any direction."""
    slipped = travel * np.array([np.cos(angle), np.sin(angle)])
    weighed = np.array(friction) * slipped
    force = np.array(friction) * weighed / np.hypot(*weighed)
    pair = neighbours(force, friction, slipped)
    assert rub(pair, 1.0)
    np.testing.assert_allclose(pair[MISSING], 0.0, atol=1e-9)


@given(force=st.tuples(FORCES, FORCES), friction=st.tuples(FRICTIONS, FRICTIONS))
def test_they_are_held_within_an_ellipse(force, friction):
    inside = np.hypot(force[0] / friction[0], force[1] / friction[1]) <= 1.0
    assert rub(neighbours(force, friction, (0.0, 0.0)), 1.0) != inside


@pytest.mark.parametrize("seed", range(6))
def test_derivatives_are_those_of_differences(seed):
    rng = np.random.default_rng(seed)
    force, friction = rng.uniform(1, 4, 2), rng.uniform(0.2, 2, 2)
    slipped = rng.normal(size=2) * 1e-4
    pair = neighbours(force, friction, slipped)
    assert rub(pair, 1.0)
    found = [pair[row : row + 2].copy() for row in (OF_FORCE, OF_FRICTION, OF_SLIP)]
    rho = pair[STIFFNESS].sum() / (friction**2).sum()

    def missing(t, F, dx):
        v = t / F + rho * F * dx
        return t - F * v / np.hypot(*v)

    for which, step in ((0, 1e-6), (1, 1e-6), (2, 1e-10)):
        for q in range(2):
            sides = []
            for sign in (1, -1):
                moved = [force.copy(), friction.copy(), slipped.copy()]
                moved[which][q] += sign * step
                sides.append(missing(*moved))
            wanted = (sides[0] - sides[1]) / (2 * step)
            np.testing.assert_allclose(
                found[which][:, q], wanted, rtol=2e-4, atol=1e-4 * np.abs(wanted).max()
            )


@given(
    force=st.tuples(FORCES, FORCES),
    friction=st.tuples(FRICTIONS, FRICTIONS),
    stiffness=st.tuples(st.floats(1e2, 1e5), st.floats(1e2, 1e5)),
)
def test_pair_comes_to_rest_where_nothing_is_missing(force, friction, stiffness):
    pair = neighbours(force, friction, (0.0, 0.0), stiffness)
    slides = come_to_rest(pair, 1.0)
    left = np.array(force) - np.array(stiffness) * pair[SLIPPED]
    after = neighbours(left, friction, pair[SLIPPED], stiffness)
    assert rub(after, 1.0) == slides or np.hypot(*(left / friction)) == pytest.approx(1.0)
    if slides:
        np.testing.assert_allclose(after[MISSING], 0.0, atol=1e-8)
    else:
        assert not pair[SLIPPED].any()


@pytest.mark.parametrize(("elements", "hinges"), [(4, 2), (20, 16), (12, 4)])
def test_system_of_chains_hinges_and_border_is_solved(elements, hinges):
    rng = np.random.default_rng(elements)
    count = elements + hinges + 4
    matrix = np.zeros((count, count))
    for row in range(elements):  # in pairs: neighbours, and the next and the last pair
        pair = row // 2
        for other in range(max(0, 2 * pair - 2), min(elements, 2 * pair + 4)):
            matrix[row, other] = rng.normal()
    for row in range(elements, elements + hinges):
        pair = (row - elements) // 2
        matrix[row, elements + 2 * pair : elements + 2 * pair + 2] = rng.normal(size=2)
        matrix[row, [0, elements - 1]] = rng.normal(size=2)
    matrix[:, -4:] = rng.normal(size=(count, 4))
    matrix[-4:] = rng.normal(size=(4, count))
    matrix += 30 * np.eye(count)
    right = rng.normal(size=count)
    wanted = np.linalg.solve(matrix, right)
    eliminate(matrix.copy(), right, elements, hinges)
    np.testing.assert_allclose(right, wanted, rtol=1e-9)
