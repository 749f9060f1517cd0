"""Members that follow commands equal the twin's own records, shared or parted."""

import numpy as np
import pytest

from twin.preset import load_preset, load_ranges
from twin.preset.preset import at_sample_time
from twin.reduced import simulate
from twin.reduced.members import Members, MemberSet
from twin.signals.excitation import paths_to

T = 0.1
PRESET = load_preset("ureteroscope").replace(servo_speed=0.0, servo_acceleration=0.0)
RANGES = load_ranges("ureteroscope")
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


def test_members_take_the_time_between_samples_in_control_periods():
    """A slow servo after a delay: the angles are those of the command on the grid of control periods."""
    slow = PRESET.replace(servo_gain=5.0, command_delay=0.06)
    period = slow.control_period
    periods = np.random.default_rng(2).integers(1, 15, 60)
    time = np.r_[0, np.cumsum(periods)] * period
    fine = np.arange(round(time[-1] / period) + 1) * period
    pull = np.sin(time)
    members = Members(MemberSet.still([slow] * 2), T)
    following = members.start(pull[:1])
    angles = [following.of_filters()[0, 0]]
    for k in range(1, len(time)):
        following = members.step(following, pull[k : k + 1], float(time[k] - time[k - 1]))
        angles.append(following.of_filters()[0, 0])
    record = simulate(slow, np.interp(fine, time, pull) * 1e-3, period).truth_deg
    # The sheath follows once in a sample there, and in each control period here.
    np.testing.assert_allclose(angles, np.interp(time, fine, record), atol=0.05)
    late = simulate(slow, pull * 1e-3, T).truth_deg  # as if all samples were T apart
    assert np.abs(angles - late).max() > 1


@pytest.mark.parametrize("step_s", [1 / 59.94, 0.0071, 0.0012, 0.137])
def test_clock_of_members_stays_within_half_a_control_period_of_the_stream(step_s):
    members = Members(MemberSet.still(DRAWN), T)
    following = members.start(np.zeros(1))
    begun = following.twins[0].time.copy()
    rng = np.random.default_rng(3)
    for k in range(1, 300):
        following = members.step(following, np.array([np.sin(k * step_s)]), step_s * rng.uniform(0.6, 1.4))
        gone = following.twins[0].time - begun
        assert np.abs(gone - following.time).max() <= PRESET.control_period / 2 + 1e-9
        np.testing.assert_allclose(gone - following.time, following.ahead, atol=1e-9)


def test_samples_between_control_periods_have_the_angle_of_their_own_pull():
    """At 250 Hz most samples end within a control period: the members' own friction has no rate."""
    members = Members(MemberSet.still(DRAWN), T)
    time = np.arange(500) * 0.004
    pulls = 1.5 * np.sin(2 * time)
    following = members.start(pulls[:1])
    angles = [following.of_filters()[0]]
    for pull in pulls[1:]:
        following = members.step(following, np.array([pull]), 0.004)
        angles.append(following.of_filters()[0])
    for place, preset in enumerate(DRAWN):
        own = at_sample_time(preset, 0.004)
        record = simulate(own, pulls * 1e-3, 0.004).truth_deg
        np.testing.assert_allclose(np.array(angles)[:, place], record, atol=0.15)


def test_members_in_a_sheath_that_moves_have_the_records_of_that_sheath():
    other, period, phase = np.array([0.5, 6.0, 2.0]), np.array([8.0, 12.0, 5.0]), np.array([0.0, 0.3, 0.9])
    moving = MemberSet(DRAWN, other, period, phase, np.zeros((3, 2)))
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
    members = Members(MemberSet(DRAWN, other, np.full(3, 4.0), np.zeros(3), np.zeros((3, 2))), T)
    following = members.start(np.array([0.7]))
    for wanted in (20.0, 18.0, 12.0):
        pull = members.common_pull_mm(following, weights, wanted, (-6.0, 6.0))
        along = members.bends_along(following, np.array([pull]), np.array([1]))
        following = members.step(following, np.array([pull]))
        assert following.of_filters()[0] @ weights == pytest.approx(wanted, abs=0.0101)
        np.testing.assert_array_equal(along[0], following.of_filters()[0])


def test_of_unknown_history_each_member_comes_by_its_own_turning_points():
    """The reduced twin along the same paths ends at the same angles; from rest they are others."""
    turns = np.array([[3.0, -2.0], [-1.0, 2.0], [0.5, 0.0]])
    members = Members(MemberSet.still(DRAWN)._replace(turns_mm=turns), T)
    begun = members.start(np.array([1.0, 1.0, -0.5]), from_rest=False).of_filters()
    paths = paths_to(turns * 1e-3, np.full(3, 1e-3), T)
    np.testing.assert_allclose(paths[:, -1], 1e-3)
    np.testing.assert_allclose(paths.max(axis=1)[0], 3e-3)
    ended = [simulate(of, path, T).truth_deg[-1] for of, path in zip(DRAWN, paths, strict=True)]
    np.testing.assert_allclose(begun[0], ended, atol=0.05)
    np.testing.assert_array_equal(begun[0], begun[1])
    assert np.abs(begun[0] - members.start(np.ones(1)).of_filters()[0]).max() > 0.3
