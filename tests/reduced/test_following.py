"""Members that follow commands equal the twin's own records, shared or parted."""

import numpy as np
import pytest

from twin.preset import load_preset, load_ranges
from twin.reduced import simulate
from twin.reduced.members import Members, MemberSet

T = 0.1
PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")
DRAWN = tuple(RANGES.draw(PRESET, np.random.default_rng(k)) for k in range(3))


def followed(pulls):
    """(B, M, N) angle of the members of filters along (B, N) pulls [mm]."""
    members = Members(MemberSet.still(DRAWN), T)
    following = members.start(pulls[:, 0])
    angles = [following.of_filters()]
    for k in range(1, pulls.shape[1]):
        following = members.step(following, pulls[:, k])
        angles.append(following.of_filters())
    return np.stack(angles, axis=-1), following


def test_filters_that_part_have_members_of_their_own():
    """Two go together for a while, a third began elsewhere: each has the records of its own command."""
    time = np.arange(60) * T
    first = 2 + np.sin(time)
    pulls = np.stack([first, np.where(time < 3, first, first + 0.3 * np.sin(time - 3)), -first])
    angles, following = followed(pulls)
    for pull, angle in zip(pulls, angles, strict=True):
        for preset, bend in zip(DRAWN, angle, strict=True):
            np.testing.assert_allclose(bend, simulate(preset, pull * 1e-3, T).truth_deg, atol=1e-9)
    assert len(following.twins) == 3


def test_the_common_pull_brings_a_weighted_bend_of_the_members_and_leaves_them_where_they_are():
    members, weights = Members(MemberSet.still(DRAWN), T), np.array([0.6, 0.5, -0.1])
    following = members.start(np.array([0.7]))
    for wanted in (20.0, -25.0, 31.0):
        before = [np.array(of) for of in following.twins[0]]
        pull = members.common_pull_mm(following, weights, wanted, (-4.0, 4.0))
        for of, was in zip(following.twins[0], before, strict=True):
            np.testing.assert_array_equal(of, was)
        following = members.step(following, np.array([pull]))
        assert weights @ following.of_filters()[0] == pytest.approx(wanted, abs=0.01)


def test_members_in_a_sheath_that_moves_have_the_records_of_that_sheath():
    other, period, phase = np.array([0.5, 6.0, 2.0]), np.array([8.0, 12.0, 5.0]), np.array([0.0, 0.3, 0.9])
    moving = MemberSet(DRAWN, other, period, phase)
    pull = 2 + np.sin(np.arange(80) * T)
    members = Members(moving, T)
    following = members.start(pull[:1])
    angles = [following.of_filters()[0]]
    for of in pull[1:]:
        following = members.step(following, np.array([of]))
        angles.append(following.of_filters()[0])
    course = np.array([moving.sheath_bend(k * T) for k in range(len(pull))])
    for place, preset in enumerate(moving.at_start()):
        record = simulate(preset, pull * 1e-3, T, sheath_bend=course[:, place])
        np.testing.assert_allclose(np.array(angles)[:, place], record.truth_deg, atol=1e-9)


def test_a_way_that_is_asked_for_is_that_which_members_would_go_and_leaves_them_where_they_are():
    members = Members(MemberSet.still(DRAWN), T)
    following = members.start(np.array([0.5]))
    before = [np.array(of) for of in following.twins[0]]
    asked = members.bends_along(following, np.array([0.7, -0.4]), np.array([1, 3]))
    for of, was in zip(following.twins[0], before, strict=True):
        np.testing.assert_array_equal(of, was)
    gone = members.step(following, np.array([0.7]))
    np.testing.assert_allclose(asked[0], gone.of_filters()[0], atol=1e-9)
    for pull in np.linspace(0.7, -0.4, 4)[1:]:
        gone = members.step(gone, np.array([pull]))
    # One long way and three short ones differ by what the tensions change within a step.
    np.testing.assert_allclose(asked[1], gone.of_filters()[0], atol=0.05)


def test_a_common_pull_knows_where_the_sheaths_go():
    """They move within the sample, so that members bend by themselves too."""
    other, weights = np.array([6.0, 0.1, 5.0]), np.array([0.5, 0.2, 0.3])
    members = Members(MemberSet(DRAWN, other, np.full(3, 4.0), np.zeros(3)), T)
    following = members.start(np.array([0.7]))
    for wanted in (20.0, 18.0, 12.0):
        pull = members.common_pull_mm(following, weights, wanted, (-6.0, 6.0))
        along = members.bends_along(following, np.array([pull]), np.array([1]))
        following = members.step(following, np.array([pull]))
        assert following.of_filters()[0] @ weights == pytest.approx(wanted, abs=0.0101)
        np.testing.assert_array_equal(along[0], following.of_filters()[0])
