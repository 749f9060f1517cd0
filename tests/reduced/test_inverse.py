"""Inverse of reduced twins: the pull brings the bend wanted, or the nearest there is, and says which."""

import numpy as np
import pytest
from both_twins import same_state
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges
from twin.reduced import ReducedTwins
from twin.reduced.twins import TOLERANCE

T = 0.1
STROKE = (-4e-3, 4e-3)
URETEROSCOPE = load_preset("ureteroscope").replace(servo_speed=0.0, servo_acceleration=0.0)
WITHIN = np.radians(0.02)
DRIVES = [
    {},
    {"servo_gain": 8.0, "servo_speed": 4e-3, "servo_acceleration": 0.05},
    {"encoder_counts": 4000, "backlash": 1e-4},
]


def drawn(count: int, seed: int, **changes) -> list:
    rng = np.random.default_rng(seed)
    ranges = load_ranges("ureteroscope")
    return [ranges.draw(URETEROSCOPE, rng).replace(**changes) for _ in range(count)]


@pytest.mark.parametrize("drive", DRIVES, ids=["rigid", "servo", "encoder"])
def test_the_pull_brings_what_it_says(drive):
    """The bend wanted where it says so; else no pull of the stroke comes nearer."""
    twins, rng = ReducedTwins(drawn(12, 1, **drive), T), np.random.default_rng(2)
    found_all = []
    for _ in range(8):
        wanted = rng.uniform(-1.0, 1.0, 12)
        found = twins.inverse(wanted, stroke=STROKE)
        before = twins.save_state()
        off = np.empty((41, 12))
        for row, pull in enumerate(np.linspace(*STROKE, 41)):
            twins.restore_state(before)
            off[row] = np.abs(twins.step(pull) - wanted)
        twins.restore_state(before)
        reached = twins.step(found.pull[:, 0])
        np.testing.assert_allclose(reached, found.bend[:, 0], atol=1e-12)
        assert ((STROKE[0] <= found.pull) & (found.pull <= STROKE[1])).all()
        np.testing.assert_array_equal(found.reached, np.abs(reached - wanted) <= np.radians(0.01))
        assert (np.abs(reached - wanted) <= off.min(axis=0) + WITHIN).all()
        found_all.append(found.reached)
    share = np.mean(found_all)
    assert share > 0.95 if not drive else 0.0 < share < 1.0


def test_nothing_moves_and_a_batch_is_each_alone():
    presets = drawn(6, 4)
    twins = ReducedTwins(presets, T)
    twins.step(1.5e-3)
    before = twins.save_state()
    wanted = np.linspace(-0.8, 0.8, 6)
    together = twins.inverse(wanted, stroke=STROKE)
    assert same_state(twins.save_state(), before)
    for place, preset in enumerate(presets):
        one = ReducedTwins([preset], T)
        one.step(1.5e-3)
        alone = one.inverse(wanted[place], stroke=STROKE)
        assert alone.pull[0] == together.pull[place]
        assert alone.bend[0] == together.bend[place]


def test_bend_out_of_reach_is_flagged_with_the_nearest():
    twins = ReducedTwins([URETEROSCOPE], T)
    most = twins.inverse(10.0, stroke=STROKE)
    assert not most.reached[0]
    twins.step(STROKE[1])
    assert most.bend[0, 0] == pytest.approx(twins.bend()[0], abs=WITHIN)


def test_servo_that_cannot_be_there_in_time_is_not_sent_further():
    """4 mm/s for 0.1 s are 0.4 mm: the shortest command that the servo follows as fast as it can."""
    preset = URETEROSCOPE.replace(servo_speed=4e-3)
    twins = ReducedTwins([preset], T)
    found = twins.inverse(1.0, stroke=STROKE)
    assert not found.reached[0]
    assert found.pull[0, 0] == pytest.approx(0.4e-3, abs=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("routing", [0.0, 0.2])
def test_both_planes_are_brought_where_they_are_wanted(routing):
    preset = URETEROSCOPE.replace(bending_planes=2, routing_friction=routing)
    twins = ReducedTwins([preset] * 3, T)
    wanted, lateral = np.array([0.5, -0.3, 0.7]), np.array([-0.2, 0.6, 0.0])
    found = twins.inverse(wanted, lateral, stroke=STROKE)
    assert found.reached.all()
    twins.step(*found.pull.T)
    np.testing.assert_allclose(twins.bend(), wanted, atol=WITHIN)
    np.testing.assert_allclose(twins.lateral_bend(), lateral, atol=WITHIN)


def test_what_cannot_be_wanted_is_refused_in_one_line():
    twins = ReducedTwins([URETEROSCOPE], T)
    for inputs, message in (
        ({"bend": np.nan}, "must be a finite number"),
        ({"bend": 0.1, "stroke": (1e-3, 1e-3)}, "the lowest pull before the highest"),
        ({"bend": 0.1, "lateral_bend": 0.1}, "has one bending plane"),
        ({"bend": 0.1, "tolerance": 0.0}, "must be positive"),
        ({"bend": 0.1, "sheath_bend": -1.0}, "not negative"),
    ):
        with pytest.raises(ValueError, match=message) as refused:
            twins.inverse(**{"stroke": STROKE} | inputs)
        assert "\n" not in str(refused.value)


def bend_after(twins: ReducedTwins, pull: float) -> np.ndarray:
    """Bend of all one sample later, at a pull; nothing moves."""
    before = twins.save_state()
    bend = twins.step(pull).copy()
    twins.restore_state(before)
    return bend


@settings(max_examples=15)
@given(
    st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5).filter(any),
    st.lists(st.floats(-0.8, 0.8), min_size=4, max_size=4),
    st.integers(0, 3),
)
def test_the_common_pull_brings_the_weighted_bend_and_moves_nothing(weights, wanted, seed):
    twins = ReducedTwins(drawn(5, seed), T)
    weights = np.array(weights) / np.sum(weights)
    for of in wanted:
        before = twins.save_state()
        pull, bend = twins.common_pull(weights, of, STROKE)
        assert same_state(twins.save_state(), before)
        assert STROKE[0] <= pull <= STROKE[1]
        reached = weights @ twins.step(pull)
        assert bend == pytest.approx(reached, abs=1e-12)
        assert abs(reached - of) <= TOLERANCE


def test_a_common_pull_out_of_reach_is_the_nearer_end_of_the_stroke():
    """The members stick: short of it, a sample would bring none of the way behind which they move."""
    twins, weights = ReducedTwins(drawn(5, 5), T), np.full(5, 0.2)
    for within, wanted, end in (
        ((-1e-5, 1e-5), 0.4, 1e-5),
        ((-1e-5, 1e-5), -0.4, -1e-5),
        (STROKE, 3.0, 4e-3),
    ):
        pull, bend = twins.common_pull(weights, wanted, within)
        assert pull == end
        assert bend == pytest.approx(weights @ bend_after(twins, end), abs=1e-12)
    # The command may stand outside of what it may go to.
    twins.step(2e-3)
    assert twins.common_pull(weights, 0.9, (-1e-3, 1e-3))[0] == 1e-3


def test_counts_of_an_encoder_that_the_bend_lies_between_are_not_out_of_reach():
    """A count is 0.3 deg here: the nearest of both is taken, not an end of the stroke."""
    preset = URETEROSCOPE.replace(encoder_counts=4000)
    count = 2 * np.pi * preset.pulley_radius / 4000
    twins = ReducedTwins([preset], T)
    for wanted in np.random.default_rng(3).uniform(-0.6, 0.6, 12):
        pull, bend = twins.common_pull(np.ones(1), wanted, STROKE)
        assert abs(bend - wanted) < count / preset.wire_offset
        assert abs(pull) < 3e-3
        twins.step(pull)
