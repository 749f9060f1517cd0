"""Command signals: inside the stroke, of bounded speed, repeatable, and reached from rest by a real path."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.signals.excitation import SETTLE_SECONDS, SIGNALS, approach, command

kinds = st.sampled_from(sorted(SIGNALS))
strokes = st.tuples(st.floats(-0.01, 0.01), st.floats(1e-5, 0.01)).map(lambda low: (low[0], low[0] + low[1]))
seeds = st.integers(0, 2**32 - 1)
lengths = st.floats(0.2, 90.0)
FASTEST = np.pi  # [half strokes / s] four sinusoids of 8 s in phase, where they are scaled no further


def draw(kind, stroke=(2e-3, 4e-3), seconds=60.0, sample_time=0.02, seed=0):
    return command(kind, stroke, seconds, sample_time, np.random.default_rng(seed))


@given(
    kind=kinds, stroke=strokes, seconds=lengths, seed=seeds, sample_time=st.sampled_from([0.01, 0.02, 0.1])
)
def test_signal_has_its_length_and_stays_in_its_stroke(kind, stroke, seconds, seed, sample_time):
    pull = draw(kind, stroke, seconds, sample_time, seed)
    low, high = stroke
    rounding = 1e-12 * max(abs(low), abs(high))
    assert pull.shape == (round(seconds / sample_time),)
    assert low - rounding <= pull.min()
    assert pull.max() <= high + rounding


@given(kind=kinds, seconds=st.floats(0.04, 90.0), seed=seeds, sample_time=st.sampled_from([0.01, 0.02]))
def test_no_signal_jumps(kind, seconds, seed, sample_time):
    """A motor follows it: at most 6.3 % of a stroke in 0.02 s, short records included."""
    pull = draw(kind, (-1.0, 1.0), seconds, sample_time, seed)
    assert np.abs(np.diff(pull)).max() <= FASTEST * sample_time * (1 + 1e-9)


@pytest.mark.parametrize("kind", sorted(set(SIGNALS) - {"multi-sine"}))
@given(stroke=strokes, seed=seeds)
def test_signal_starts_at_the_middle_of_its_stroke(kind, stroke, seed):
    low, high = stroke
    assert draw(kind, stroke, 20.0, 0.02, seed)[0] == pytest.approx((low + high) / 2, abs=1e-9 * (high - low))


@pytest.mark.parametrize("kind", sorted(SIGNALS))
def test_long_signal_reverses_and_uses_its_stroke(kind):
    low, high = 2e-3, 4e-3
    least = 0.95 if kind in ("sine", "triangle") else 0.5
    for seed in range(20):
        pull = draw(kind, (low, high), seed=seed)
        assert np.ptp(pull) > least * (high - low)
        moves = np.sign(np.diff(pull))
        assert np.count_nonzero(np.diff(moves[moves != 0])) >= 3


@given(
    start=st.floats(-0.02, 0.02), sample_time=st.sampled_from([0.01, 0.02, 0.1]), speed=st.floats(5e-4, 1e-2)
)
def test_approach_goes_from_rest_to_the_start_without_turning_back(start, sample_time, speed):
    path = approach(start, sample_time, speed)
    steps = np.diff(np.concatenate([[0.0], path])) * np.sign(start)
    assert (steps >= -1e-15).all()
    assert path[-1] == start
    rest = round(SETTLE_SECONDS / sample_time)
    assert (path[-rest:] == start).all()
    moving = len(path) - rest
    assert path[moving - 1] == start  # no jump between the ramp and the rest
    if moving > 1:
        assert moving * sample_time == pytest.approx(abs(start) / speed, abs=sample_time)
        peak = np.pi / 2 * abs(start) / (moving * sample_time)  # of a cosine profile
        assert steps.max() <= peak * sample_time * (1 + 1e-9)


def test_unusable_signals_are_refused():
    for change, rule in (
        ({"kind": "sinus"}, "unknown signal 'sinus'; valid: sine, decaying-sine, triangle"),
        ({"stroke": (4e-3, 2e-3)}, r"stroke \[4, 2\] mm: the first must be below the second"),
        ({"stroke": (2e-3, np.nan)}, "first must be below"),
        ({"seconds": 0.03}, "at least two samples"),
        ({"sample_time": 0.0}, "at least two samples"),
    ):
        with pytest.raises(ValueError, match=rule):
            draw(**{"kind": "sine", **change})
