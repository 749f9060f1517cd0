"""References: a hold that is not scored, then a signal in the middle of what is reached."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.control.conditions import FAST_PERIOD_S, SHARE, SIGNALS, reference
from twin.control.trial import HOLD_S

kinds = st.sampled_from(SIGNALS)


@given(kinds, st.floats(-90, 80), st.floats(1, 120), st.integers(0, 2**32 - 1), st.sampled_from([0.02, 0.1]))
def test_it_holds_then_stays_in_the_middle_of_what_is_reached(kind, low, span, seed, sample_time):
    reached = (low, low + span)
    wanted = reference(kind, reached, 20.0, sample_time, np.random.default_rng(seed))
    held = round(HOLD_S / sample_time)
    assert wanted.shape == (held + round(20.0 / sample_time),)
    np.testing.assert_array_equal(wanted[:held], wanted[held])
    rest = (1 - SHARE) / 2 * span
    assert low + rest - 1e-9 <= wanted.min()
    assert wanted.max() <= low + span - rest + 1e-9


def test_the_fast_one_is_a_sine_of_four_seconds_over_all_of_its_share():
    wanted = reference("fast-sine", (-40.0, 60.0), 40.0, 0.02, np.random.default_rng(0))
    moving = wanted[round(HOLD_S / 0.02) :]
    period = round(FAST_PERIOD_S / 0.02)
    np.testing.assert_allclose(moving[period:], moving[:-period], atol=1e-9)
    np.testing.assert_allclose(moving[period // 2 :] - 10, 10 - moving[: -period // 2], atol=1e-9)
    assert moving.max() - moving.min() == pytest.approx(SHARE * 100, rel=1e-6)
    spectrum = np.abs(np.fft.rfft(moving - moving.mean()))
    assert np.argmax(spectrum) == round(40.0 / FAST_PERIOD_S)


@pytest.mark.parametrize("kind", [kind for kind in SIGNALS if kind != "random-steps"])
def test_slow_ones_use_nearly_all_of_their_share_and_do_not_jump(kind):
    wanted = reference(kind, (-50.0, 50.0), 60.0, 0.1, np.random.default_rng(3))
    assert np.ptp(wanted) > 0.75 * SHARE * 100
    steps = [abs(after - before) for before, after in itertools.pairwise(wanted)]
    assert max(steps) < 2 * np.pi / FAST_PERIOD_S * 0.1 * SHARE * 50 * 1.01


@pytest.mark.parametrize(
    ("kind", "seconds", "message"),
    [
        ("triangle", 20.0, "unknown reference 'triangle'; valid: sine, multi-sine, random-steps, fast-sine"),
        ("x" * 900, 20.0, "unknown reference"),
        *(
            (kind, seconds, "needs at least two samples")
            for kind in SIGNALS
            for seconds in (0.0, 0.1, np.nan)
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(kind, seconds, message):
    with pytest.raises(ValueError, match=message) as refused:
        reference(kind, (-50.0, 50.0), seconds, 0.1, np.random.default_rng(0))
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 150
