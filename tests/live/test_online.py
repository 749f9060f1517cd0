"""One live stream: the same bits as whole records, and finite whatever comes."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import AdaptiveActiveModel, BiasedActiveModel, RobustActiveModel
from twin.estimation.koopman import KoopmanFilter
from twin.estimation.soundness import is_sound
from twin.estimation.tuning import ConstantGain
from twin.live.online import OnlineEstimator
from twin.live.reading import Health

T = 0.1
MODEL = COLEMAN_HODGDON
PLAIN = ActiveModel(MODEL, T, measurement_variance=1.0)
ESTIMATORS = {
    "active model": PLAIN,
    "robust": RobustActiveModel(**vars(PLAIN)),
    "adaptive": AdaptiveActiveModel(PLAIN),
    "biased": BiasedActiveModel(**vars(PLAIN)),
    "constant gain": ConstantGain(**vars(PLAIN), gain=(0.3, 0.2)),
    "koopman": KoopmanFilter(
        np.array([[1.6, -0.6, 0], [-0.5, 0, 0]]), np.array([[2.0, 0, 0], [10.0, 0, 0.1]]), 1e-2
    ),
}
TIME = np.arange(300) * T
PULL = 3 + np.sin(2 * np.pi * TIME / 12)
MEASUREMENT = MODEL.response(PULL, 60.0) + np.random.default_rng(0).normal(size=len(PULL))

each_estimator = pytest.mark.parametrize("estimator", ESTIMATORS.values(), ids=ESTIMATORS.keys())
any_number = st.floats(allow_nan=True, allow_infinity=True)
rarely_broken = st.one_of(st.floats(-5, 5), st.floats(-5, 5), any_number)
samples = st.lists(
    st.tuples(st.one_of(st.floats(-1, 30), any_number), rarely_broken, rarely_broken), max_size=40
)


def begun(estimator=PLAIN) -> OnlineEstimator:
    """A stream that has had one sample, at time 0 and 3 mm."""
    stream = OnlineEstimator(estimator, T, 60.0)
    stream.push(0.0, 3.0, 60.0)
    return stream


@each_estimator
def test_even_stream_equals_whole_records_bit_for_bit(estimator):
    measurement = MEASUREMENT.copy()
    measurement[100:130] = np.nan
    measurement[7] = np.nan
    stream = OnlineEstimator(estimator, T, 75.0)
    live = [stream.push(*sample) for sample in zip(TIME, PULL, measurement, strict=True)]
    np.testing.assert_array_equal(live, estimator.estimate(PULL, measurement, 75.0)[0])
    assert (stream.steps, stream.ignored, stream.filled, stream.restarts) == (299, 0, 0, 0)


@each_estimator
def test_gap_is_filled_as_a_whole_record_without_these_measurements(estimator):
    kept = np.r_[0:50, 57:120, 121:300]
    stream = OnlineEstimator(estimator, T, 75.0)
    live = [stream.push(TIME[k], PULL[k], MEASUREMENT[k]) for k in kept]
    between = np.setdiff1d(np.arange(300), kept)
    pull, measurement = PULL.copy(), MEASUREMENT.copy()
    pull[50:57] = np.linspace(PULL[49], PULL[57], 9)[1:-1]
    pull[120] = np.linspace(PULL[119], PULL[121], 3)[1]
    measurement[between] = np.nan
    np.testing.assert_array_equal(live, estimator.estimate(pull, measurement, 75.0)[0, kept])
    assert stream.filled == len(between)


@pytest.mark.parametrize("broken", [math.nan, math.inf, -math.inf])
def test_broken_number_is_missing(broken):
    stream, other = begun(), begun()
    assert stream.push(T, 3.2, broken) == other.push(T, 3.2, math.nan)
    assert stream.push(2 * T, broken, 63.0) == other.push(2 * T, math.nan, 63.0)
    assert stream.health == Health.NO_PULL


@each_estimator
def test_samples_without_a_pull_are_repeated_along_the_line_to_the_next_one(estimator):
    clean, stream = OnlineEstimator(estimator, T, 75.0), OnlineEstimator(estimator, T, 75.0)
    line = PULL.copy()
    line[200:206] = np.linspace(PULL[199], PULL[206], 8)[1:-1]
    for k, sample in enumerate(zip(TIME, line, MEASUREMENT, strict=True)):
        expected = clean.push(*sample)
        missing = 200 <= k < 206
        found = stream.push(sample[0], math.nan if missing else sample[1], sample[2])
        if missing:
            assert stream.health == Health.NO_PULL
        else:
            assert found == pytest.approx(expected, abs=1e-9)
    assert stream.restarts == 0


def test_missing_pull_goes_on_at_its_speed_and_comes_to_rest():
    stream, standing = begun(), begun()
    for k in range(1, 21):
        stream.push(k * T, 3.0 + 0.1 * k)
        standing.push(k * T, 3.0)
    pulls = []
    for k in range(21, 41):
        stream.push(k * T, math.nan)
        standing.push(k * T, math.nan)
        pulls.append(stream.pull_mm)
    assert pulls[0] == pytest.approx(5.1, abs=1e-3)
    assert pulls[10:] == pytest.approx([5.55] * 10, abs=1e-3)  # half a second's way at 1 mm/s, and a bit
    assert standing.pull_mm == 3.0


def test_missing_pull_after_a_jump_stays_near_and_the_next_one_is_taken():
    stream = begun()
    stream.push(1.0, 12.0)  # after a gap
    for k in range(11, 41):
        stream.push(k * T, math.nan)
        assert abs(stream.pull_mm - 12.0) < 7  # half a second's way at the fastest
    stream.push(4.1, 12.0)
    assert stream.health & Health.IMPLAUSIBLE_PULL == Health.GOOD
    assert stream.pull_mm == 12.0


@pytest.mark.parametrize("far", [1e300, -1e20, 720.1])
def test_implausible_measurement_is_missing_and_flagged(far):
    stream, other = begun(), begun()
    assert stream.push(T, 3.0, far) == other.push(T, 3.0, math.nan)
    assert stream.health == Health.IMPLAUSIBLE_MEASUREMENT
    assert stream.push(2 * T, 3.0, 719.0) == other.push(2 * T, 3.0, math.nan)
    assert stream.health == Health.OUTLIER
    stream.push(3 * T, 3.0, 60.0)
    assert stream.health == Health.GOOD


def test_measurements_that_agree_are_believed_after_half_a_second():
    stream = begun()
    live = [stream.push(k * T, 3.0, 400.0 + k % 2) for k in range(1, 6)]
    np.testing.assert_allclose(live, [60.0, 60.0, 60.0, 60.0, 400.5], atol=0.6)
    assert stream.health == Health.OUTLIER | Health.RESTARTED
    assert stream.restarts == 1


def test_command_that_has_jumped_is_believed_after_half_a_second():
    stream = begun()
    for k in range(1, 6):
        stream.push(k * T, 50.0, math.nan)
    assert stream.health == Health.IMPLAUSIBLE_PULL | Health.NO_MEASUREMENT
    assert stream.bend_deg == pytest.approx(50 * 22.38, rel=0.05)
    stream.push(6 * T, 50.0, math.nan)
    assert stream.health == Health.NO_MEASUREMENT


@pytest.mark.parametrize("begin", [-5e9, -7.0, -0.5, 3600.0, 1e6, 9e9])
def test_clock_that_stays_elsewhere_is_believed_within_a_second(begin):
    stream = begun()
    for k in range(1, 30):
        stream.push(begin + k * T, 3.0, 60.0)
    assert stream.health == Health.GOOD
    assert stream.ignored <= 10
    assert stream.steps >= 19


@pytest.mark.parametrize("wrong", [None, "3.0", b"3", [3.0], {}, 1j, np.ones(1), object(), "x" * 10_000])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_what_is_no_number_is_refused_in_one_line_and_changes_nothing(wrong, place):
    stream, other = begun(), begun()
    sample = [T, 3.1, 62.0]
    sample[place] = wrong
    with pytest.raises(ValueError, match="must be a number") as error:
        stream.push(*sample)
    assert len(str(error.value)) < 300
    assert "\n" not in str(error.value)
    assert (stream.pushed, stream.health) == (other.pushed, other.health)
    assert stream.push(T, 3.1, 62.0) == other.push(T, 3.1, 62.0)


def test_no_sample_time_makes_a_gap_without_end():
    for sample_time in (5e-324, 1e-12, 1e300):
        stream = OnlineEstimator(PLAIN, sample_time, 60.0)
        for time_s in (0.0, 1e-12, 1e4):
            stream.push(time_s, 3.0, 60.0)
        assert stream.filled <= 2 * 2000


@each_estimator
@settings(max_examples=60)
@given(stream=samples)
def test_estimate_is_finite_whatever_comes(estimator, stream):
    live = OnlineEstimator(estimator, T, 60.0)
    for sample in stream:
        assert math.isfinite(live.push(*sample))
    begun = live.state is not None
    assert live.pushed == len(stream) == live.ignored + live.waiting + begun + live.steps
    assert is_sound(live.state)


@settings(max_examples=30)
@given(data=st.data())
def test_repeated_and_reversed_stamps_change_nothing(data):
    """Whatever is sent again after it was sent, the estimates are those of the stream without it."""
    stream, other = begun(), begun()
    for k in range(1, 30):
        assert stream.push(TIME[k], PULL[k], MEASUREMENT[k]) == other.push(TIME[k], PULL[k], MEASUREMENT[k])
        for late in data.draw(st.lists(st.integers(0, k), max_size=2)):
            assert stream.push(TIME[late], PULL[late] + 1, MEASUREMENT[late] - 9) == other.bend_deg
    assert (stream.steps, other.ignored) == (29, 0)


@dataclasses.dataclass(frozen=True)
class HidesNan(ActiveModel):
    """An active model that loses its covariance, and not its angle, at measurements of 61 deg."""

    def step(self, state, pull_mm, previous_pull_mm, measurement_deg):
        stepped = super().step(state, pull_mm, previous_pull_mm, measurement_deg)
        lost = stepped._replace(covariance=np.full_like(stepped.covariance, np.nan))
        return lost if measurement_deg[0] == 61 else stepped


def test_step_to_a_state_that_is_not_sound_behind_its_angle_is_not_taken():
    stream = begun(HidesNan(MODEL, T))
    for k in range(1, 4):
        assert stream.push(k * T, 3.0, 61.0) == (61.0 if k == 3 else 60.0)
        assert Health.REFUSED in stream.health
        assert is_sound(stream.state)
    assert stream.restarts == 1
    assert Health.RESTARTED in stream.health


@pytest.mark.parametrize("far", [1.7e308, -200.1, 150.0, -3.0])
def test_implausible_pull_is_held_and_flagged(far):
    stream, other = begun(), begun()
    assert stream.push(T, far, 61.0) == other.push(T, 3.0, 61.0)
    assert stream.health == Health.IMPLAUSIBLE_PULL
