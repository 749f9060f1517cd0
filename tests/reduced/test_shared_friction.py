"""Law of two neighbours that rub as one, its derivatives, and the linear system that it is part of."""

import numpy as np
import pytest
from called_kernels import called_by_python
from hypothesis import given
from hypothesis import strategies as st

from twin.reduced import two_planes
from twin.reduced.two_planes import AHEAD, BEHIND, BORDER, MAIN, MISSING

come_to_rest, eliminate, rub = map(
    called_by_python, (two_planes.come_to_rest, two_planes.eliminate, two_planes.rub)
)

FORCES = st.floats(-5.0, 5.0)
FRICTIONS = st.floats(0.05, 3.0)
STIFFNESS = 3e4, 5e4


def missing(force, friction, slipped, stiffness=STIFFNESS) -> np.ndarray:
    """Force that is missing at two neighbours that slide."""
    return np.array(force) - friction * np.array(rub(force, friction, slipped, sum(stiffness)).along)


@given(friction=st.tuples(FRICTIONS, FRICTIONS), angle=st.floats(-np.pi, np.pi), travel=st.floats(1e-6, 1e-3))
def test_nothing_is_missing_where_friction_opposes_the_slip_as_one(friction, angle, travel):
    """Least elastic energy and dissipation |F dx|: t = F (F dx) / |F dx|, for a slip in any direction."""
    slipped = travel * np.array([np.cos(angle), np.sin(angle)])
    weighed = np.array(friction) * slipped
    force = np.array(friction) * weighed / np.hypot(*weighed)
    assert rub(tuple(force), friction, tuple(slipped), sum(STIFFNESS)).size > 1.0
    np.testing.assert_allclose(missing(tuple(force), friction, tuple(slipped)), 0.0, atol=1e-9)


@given(force=st.tuples(FORCES, FORCES), friction=st.tuples(FRICTIONS, FRICTIONS))
def test_they_are_held_within_an_ellipse(force, friction):
    pulled = np.hypot(force[0] / friction[0], force[1] / friction[1])
    assert rub(force, friction, (0.0, 0.0), sum(STIFFNESS)).size == pytest.approx(pulled)


@pytest.mark.parametrize("seed", range(6))
def test_derivatives_are_those_of_differences(seed):
    rng = np.random.default_rng(seed)
    force, friction = rng.uniform(1, 4, 2), rng.uniform(0.2, 2, 2)
    slipped = rng.normal(size=2) * 1e-4
    at = rub(tuple(force), tuple(friction), tuple(slipped), sum(STIFFNESS))
    rho = sum(STIFFNESS) / (friction**2).sum()
    found = [
        np.eye(2) - np.outer(at.turned, at.across * np.array(at.of_force)),
        -np.diag(at.along) - np.outer(at.turned, at.across * np.array(at.of_friction)),
        -np.outer(at.turned, at.across * np.array(at.of_slip)),
    ]

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
    slipped, slides = come_to_rest(force, friction, (0.0, 0.0), stiffness, 1.0)
    left = tuple(np.array(force) - np.array(stiffness) * slipped)
    size = rub(left, friction, slipped, sum(stiffness)).size
    assert (size > 1.0) == slides or size == pytest.approx(1.0)
    if slides:
        np.testing.assert_allclose(missing(left, friction, slipped, stiffness), 0.0, atol=1e-8)
    else:
        assert slipped == (0.0, 0.0)


@pytest.mark.parametrize("nodes", [3, 11])
def test_system_of_a_chain_of_two_planes_and_its_border_is_solved(nodes):
    rng = np.random.default_rng(nodes)
    rows = rng.normal(size=(nodes, 2, 9))
    rows[:, range(2), range(MAIN, MAIN + 2)] += 30
    rows[0, :, AHEAD : AHEAD + 2] = rows[-1, :, BEHIND : BEHIND + 2] = 0
    matrix = np.zeros((nodes, 2, nodes, 2))
    for i in range(nodes):
        matrix[i, :, i] = rows[i, :, MAIN : MAIN + 2]
        if i > 0:
            matrix[i, :, i - 1] = rows[i, :, AHEAD : AHEAD + 2]
        if i < nodes - 1:
            matrix[i, :, i + 1] = rows[i, :, BEHIND : BEHIND + 2]
    sides = rows[..., MISSING : BORDER + 2].copy()
    eliminate(rows)
    wanted = np.linalg.solve(matrix.reshape(2 * nodes, -1), sides.reshape(2 * nodes, -1))
    np.testing.assert_allclose(rows[..., MISSING:].reshape(2 * nodes, -1), wanted, rtol=1e-9)
