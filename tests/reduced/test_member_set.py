"""Members of an estimator: how their sheaths move, and what a file says of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.preset import load_preset, load_ranges
from twin.reduced.members import MemberSet, members_from_dict, members_to_dict

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")
DRAWN = tuple(RANGES.draw(PRESET, np.random.default_rng(k)) for k in range(3))
OWN = np.array([preset.sheath_bend for preset in DRAWN])
OTHER = np.array([0.5, OWN[1], 2.0])
MOVING = MemberSet(DRAWN, OTHER, np.array([10.0, 1.0, 4.0]), np.array([0.0, 0.0, 0.25]), np.zeros((3, 2)))


def test_a_sheath_goes_to_the_other_end_and_back_at_one_pace():
    bends = np.array([MOVING.sheath_bend(time) for time in np.arange(0.0, 10.0, 0.1)])
    np.testing.assert_allclose(bends[0, 0], OWN[0])
    np.testing.assert_allclose(bends[50, 0], 0.5)
    np.testing.assert_allclose(np.abs(np.diff(bends[:, 0])), abs(0.5 - OWN[0]) / 50)
    np.testing.assert_array_equal(bends[:, 1], OWN[1])
    np.testing.assert_allclose(bends[0, 2], (OWN[2] + 2.0) / 2)
    np.testing.assert_allclose(bends[30, 2], OWN[2])  # a phase of one is that of none


@given(st.floats(0, 1e5), st.floats(0, 1e3))
def test_later_is_the_same_course_from_another_start(begin, time):
    later = MOVING.later(begin)
    np.testing.assert_allclose(later.sheath_bend(time), MOVING.sheath_bend(begin + time), atol=1e-6)
    starts = [preset.sheath_bend for preset in later.at_start()]
    np.testing.assert_allclose(starts, later.sheath_bend(0.0), atol=1e-12)
    assert [preset.replace(sheath_bend=1.0) for preset in later.at_start()] == [
        preset.replace(sheath_bend=1.0) for preset in DRAWN
    ]


def same(left, right):
    return left.presets == right.presets and all(map(np.array_equal, left[1:], right[1:]))


@pytest.mark.parametrize("members", [MemberSet.still(DRAWN), MOVING], ids=["still", "moving"])
def test_a_file_gives_the_members_back(members):
    held = members_to_dict(members)
    assert ("sheath" in held) is members.moves
    assert same(members_from_dict(held), members)


def sheath(**changes):
    return {"sheath": members_to_dict(MOVING)["sheath"] | changes}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"drawn": {"pretension": [5.0, 6.0], "wire_offset": [1e-3] * 3}}, "from 2 to 512"),
        ({"drawn": {"pretension": [5.0, -6.0]}}, "pretension = -6"),
        ({"drawn": {"nothing": [5.0, 6.0]}}, "unknown preset parameter"),
        ({"preset": {"control_period": 1e-6, "time_step": 1e-6}}, "must be at least 0.001 s"),
        ({"preset": {"gravity_x": 9.81}}, "gravity_x = 9.81"),
        ({"preset": {"bending_planes": 2}}, "two bending planes"),
        ({"drawn": {"vertebrae": [8, 9]}}, "vertebrae must be the same for all"),
        (None, "members = None"),
        (sheath(other=[1.0, 2.0]), "each with a value of all that differs"),
        (sheath(other=[1.0, 2.0, 99.0]), "bends of their sheaths"),
        (sheath(other=[1.0, 2.0, np.nan]), "other"),
        (sheath(period=[1.0, 2.0, 0.0]), "period"),
        ({"sheath": {"other": [1.0, 2.0, 3.0]}}, "sheath"),
    ],
)
def test_members_that_cannot_be_are_refused_in_one_line(change, message):
    values = None if change is None else members_to_dict(MemberSet.still(DRAWN)) | change
    with pytest.raises(ValueError, match=message) as error:
        members_from_dict(values)
    assert "\n" not in str(error.value)
