"""Whatever time stamps a live stream has, its record has times that readers take, and none of it is lost."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_streams import ESTIMATE, METHOD, record, sample
from recorded import messages

from twin.live.checks import StreamClock, StreamLimits
from twin.live.reading import Health
from twin.recording import read_episode
from twin.recording.live import LiveMessages, RecordClock
from twin.recording.messages import LARGEST_TIME
from twin.signals.sensor import LARGEST_TIME_S

ANY_TIME = st.one_of(
    st.floats(),
    st.floats(-1e3, 1e3),
    st.integers(-(10**400), 10**400),
    st.sampled_from([0.0, -0.0, 5e-324, 1e-10, LARGEST_TIME_S, -LARGEST_TIME_S, 9.3e9, 2.0**63, 2.0**64]),
)
REFUSED = (Health.NO_TIME, Health.LATE, Health.CLOCK_JUMP)
ANY_HEALTH = st.sampled_from([Health.GOOD, Health.GOOD, Health.CLOCK_RESET, Health.GAP, *REFUSED])


def times_of(stamps, step_s=0.02):
    """Log times of a stream whose faults the estimators' own clock finds, NaN where it has none [s]."""
    judge, clock = StreamClock(step_s, StreamLimits()), RecordClock()
    found = []
    for stamp in stamps:
        judge.elapsed(stamp)
        time = clock.at(stamp, judge.fault)
        found.append(math.nan if time is None else time / 1e9)
    return found


@given(st.lists(st.tuples(ANY_TIME, ANY_HEALTH), max_size=60))
def test_times_of_any_stream_increase_and_fit(stamps):
    stream, before, sequence = LiveMessages(METHOD), -1, 0
    for time_s, health in stamps:
        timed = stream.of(sample(time_s, health=health))
        sequence += 1
        if timed is None:
            assert before == -1
            continue
        log_time, publish_time, messages = timed
        assert 0 <= log_time <= LARGEST_TIME
        assert 0 <= publish_time <= LARGEST_TIME
        if "/command" in messages:
            assert log_time > before
            assert set(messages) == {"/command", "/measurement", ESTIMATE, "/health"}
        else:
            assert set(messages) == {"/health"}
            assert log_time == before
        before = log_time
    assert stream.samples + stream.ignored == sequence


@settings(max_examples=20)
@given(
    st.lists(st.tuples(ANY_TIME, ANY_HEALTH), min_size=2, max_size=30),
    st.lists(st.sampled_from([1.0, math.nan, math.inf, -1e300, 10**400]), min_size=30, max_size=30),
)
def test_a_file_of_any_stream_is_an_episode_or_too_short(tmp_path_factory, stamps, values):
    path = tmp_path_factory.getbasetemp() / "any.mcap"
    path.unlink(missing_ok=True)
    made = record(
        path,
        [sample(time_s, value, 2.0, health) for (time_s, health), value in zip(stamps, values, strict=False)],
    ).stream
    if made.samples >= 2:
        assert len(messages(path)[ESTIMATE]) == made.samples
        assert len(read_episode(path).time) == made.samples


@given(st.sets(st.integers(0, 10**14), min_size=1, max_size=50))
def test_times_that_go_on_are_those_of_the_sender(steps):
    stamps = [step / 5e4 for step in sorted(steps)]  # 20 us apart or more
    clock = RecordClock()
    assert [clock.at(stamp) for stamp in stamps] == [round(stamp * 1e9) for stamp in stamps]


def test_one_wrong_stamp_costs_one_sample():
    good = [k * 0.02 for k in range(20)]
    for wrong in (math.nan, 1e300, -1.0, good[4], 2e8):
        stamps = [*good[:5], wrong, *good[5:]]
        found = times_of(stamps)
        assert math.isnan(found[5])
        assert found[:5] + found[6:] == pytest.approx(good)


@pytest.mark.parametrize("other_s", [0.0, -3e4, 1.7e9])
def test_another_clock_leaves_no_jump_in_the_record(other_s):
    """As where a sender restarts, or gets the date: fifty samples until the estimator accepts it."""
    old = [5.0 + k * 0.02 for k in range(100)]
    found = times_of([*old, *(other_s + k * 0.02 for k in range(200))])
    assert found[:100] == pytest.approx(old)
    recorded = [time for time in found if not math.isnan(time)]
    assert len(recorded) == 100 + 151
    assert recorded[100] - recorded[99] == pytest.approx(50 * 0.02)
    assert found[-1] == pytest.approx(old[-1] + 200 * 0.02)
