"""Members that follow commands equal the twin's own records, shared or parted."""

import numpy as np
import pytest

from twin.preset import load_preset, load_ranges
from twin.reduced import simulate
from twin.reduced.following import Members, members_from_dict, members_to_dict

T = 0.1
PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")
DRAWN = tuple(RANGES.draw(PRESET, np.random.default_rng(k)) for k in range(3))


def followed(pulls):
    """(B, M, N) angle of the members of filters along (B, N) pulls [mm]."""
    members = Members(DRAWN, T)
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
            np.testing.assert_allclose(bend, simulate(preset, pull * 1e-3, T).bend_deg, atol=1e-9)
    assert len(following.twins) == 3


def test_filters_of_one_command_share_their_members():
    _, following = followed(np.tile(np.sin(np.arange(20) * T), (5, 1)))
    assert len(following.twins) == 1
    assert following.of_filters().shape == (5, 3)


def test_a_step_leaves_the_state_before_it_as_it_is():
    members = Members(DRAWN, T)
    begun = members.start(np.array([0.5]))
    before = [np.array(of) for of in begun.twins[0]]
    once, again = (members.step(begun, np.array([1.5])) for _ in range(2))
    np.testing.assert_array_equal(once.bend_deg, again.bend_deg)
    for of, was in zip(begun.twins[0], before, strict=True):
        np.testing.assert_array_equal(of, was)


def test_a_file_gives_the_members_back():
    assert members_from_dict(members_to_dict(DRAWN)) == DRAWN


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"drawn": {}}, "drawn"),
        ({"drawn": {"pretension": [5.0]}}, "at least 2 items"),
        ({"drawn": {"pretension": [5.0, 6.0], "wire_offset": [1e-3] * 3}}, "from 2 to 512"),
        ({"drawn": {"pretension": [5.0, -6.0]}}, "pretension = -6"),
        ({"drawn": {"nothing": [5.0, 6.0]}}, "unknown preset parameter"),
        ({"drawn": {"pretension": [5.0, "six"]}}, "drawn"),
        ({"preset": {"nothing": 1.0}}, "unknown preset parameter"),
        ({"preset": 3}, "preset = 3"),
        ({"preset": {"control_period": 1e-6, "time_step": 1e-6}}, "must be at least 0.001 s"),
        ({"preset": {"gravity_x": 9.81}}, "gravity_x = 9.81"),
        ({"preset": {"bending_planes": 2}}, "two bending planes"),
        ({"drawn": {"vertebrae": [8, 9]}}, "vertebrae must be the same for all"),
        (None, "members = None"),
    ],
)
def test_members_that_cannot_be_are_refused_in_one_line(change, message):
    values = None if change is None else members_to_dict(DRAWN) | change
    with pytest.raises(ValueError, match=message) as error:
        members_from_dict(values)
    assert "\n" not in str(error.value)
