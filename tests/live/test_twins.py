"""A runtime with twins of the endoscope, whose sensor turns wrong."""

import numpy as np
import pytest
from models import COLEMAN_HODGDON

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment
from twin.estimation.learned.trained_file import TrainedFile
from twin.live.assured import AssuredEstimator
from twin.live.reading import WRONG_SENSOR, Alarm, Health, RunCounts, Source, StreamSample
from twin.live.twins import TWINS, draw_twins, twins_of
from twin.preset import load_preset, load_ranges
from twin.reduced import simulate_batch
from twin.signals.excitation import command

T, R = 0.1, 0.1
STROKE = (2e-3, 4e-3)
FILTER = ActiveModel(COLEMAN_HODGDON, T, (1e-3, 4e-2), R, (100.0, 1.0))
DEPLOYMENT = Deployment(FILTER, (1.5, 4.5), (20.0, 120.0), 3.0, 60.0)
BEGINS, ENDS = 400, 600


@pytest.fixture(scope="module")
def twins():
    return draw_twins(load_preset("ureteroscope"), load_ranges("ureteroscope"), (2.0, 4.0), T, from_rest=True)


@pytest.fixture(scope="module")
def endoscope():
    """Pull [mm] and angle [deg] of one that is none of the twins."""
    rng = np.random.default_rng(5)
    pull = command("sine", STROKE, 75.0, T, rng)
    other = load_ranges("ureteroscope").draw(load_preset("ureteroscope"), rng)
    (episode,) = simulate_batch([other], [pull], T)
    return pull * 1e3, episode.truth_deg


def run(twins, endoscope, measured):
    pull, truth = endoscope
    live = AssuredEstimator("test", FILTER, FILTER, DEPLOYMENT, float(truth[0]), twins=twins)
    return live, [live.push(k * T, pull[k], measured[k]) for k in range(len(pull))]


def test_while_the_sensor_has_the_wrong_sign_the_twins_predict_for_a_filter_that_has_none(twins, endoscope):
    _, truth = endoscope
    measured = truth + np.sqrt(R) * np.random.default_rng(0).standard_normal(len(truth))
    measured[BEGINS:ENDS] *= -1
    live, readings = run(twins, endoscope, measured)
    error = np.abs([of.bend_deg for of in readings] - truth)
    by_twins = np.array([of.source is Source.TWINS for of in readings])
    assert not any(of.alarms & WRONG_SENSOR for of in readings[:BEGINS])
    first = np.flatnonzero(by_twins)[0]
    assert BEGINS < first <= BEGINS + 10
    assert by_twins[first:ENDS].all()
    assert readings[ENDS - 1].alarms & Alarm.SIGN
    counts = RunCounts()
    for k, reading in enumerate(readings):
        counts.add(StreamSample(k * T, 0.0, 0.0, reading))
    assert counts.to_dict()["alarms_began_s"]["SIGN"] == pytest.approx(T * first, abs=1.0)
    assert counts.share(Source.TWINS) == np.mean(by_twins)
    assert error[first:ENDS].max() < 5 < np.abs(measured - truth)[BEGINS:ENDS].min()
    back = np.flatnonzero(by_twins)[-1] + 1
    assert back < ENDS + 100
    inside = [of.low_deg <= angle <= of.high_deg for of, angle in zip(readings, truth, strict=True)]
    assert np.mean(inside[first:back]) > 0.95
    assert live.reading.source is Source.ADVANCED
    assert error[back + 10 :].max() < 2 * error[50:BEGINS].max()


def test_wrong_pulls_that_make_the_twins_start_again_are_no_fault_of_the_sensor(twins, endoscope):
    pull, truth = endoscope
    measured = truth + np.sqrt(R) * np.random.default_rng(2).standard_normal(len(truth))
    seen = pull.copy()
    seen[BEGINS : BEGINS + 20] += 5.0
    live, readings = run(twins, (seen, truth), measured)
    assert live.advanced.restarts > 0
    assert not any(of.alarms & WRONG_SENSOR for of in readings[BEGINS + 30 :])


def test_a_zero_that_has_moved_is_accepted_and_the_interval_includes_both(twins, endoscope):
    truth = endoscope[1]
    measured = truth + np.sqrt(R) * np.random.default_rng(3).standard_normal(len(truth))
    measured[300:550] += 15.0
    _, readings = run(twins, endoscope, measured)
    offset = np.array([bool(of.alarms & Alarm.OFFSET) for of in readings])
    by_twins = np.array([of.source is Source.TWINS for of in readings])
    accepted = 300 + np.flatnonzero(~by_twins[310:550])[0] + 10
    assert accepted < 480
    assert offset[accepted:545].all()
    inside = [of.low_deg <= angle <= of.high_deg for of, angle in zip(readings, truth, strict=True)]
    assert np.mean(inside[accepted:545]) > 0.95
    assert not offset[:300].any()
    assert not offset[-20:].any()  # it has moved back


def test_a_pull_that_no_twin_can_go_to_is_never_followed(twins, endoscope):
    pull, truth = endoscope
    for farthest in (-150.0, 21.0):
        seen = pull.copy()
        seen[BEGINS : BEGINS + 50] = farthest
        live, readings = run(twins, (seen, truth), truth)
        assert all(of.health & Health.IMPLAUSIBLE_PULL for of in readings[BEGINS : BEGINS + 50])
        assert abs(live.fallback.pull_mm - pull[-1]) < 1e-9


def test_twins_leave_a_healthy_stream_as_it_is(twins, endoscope):
    measured = endoscope[1] + np.sqrt(R) * np.random.default_rng(1).standard_normal(len(endoscope[1]))
    with_twins, without = (run(one, endoscope, measured)[1] for one in (twins, None))
    assert [of.bend_deg for of in with_twins] == [of.bend_deg for of in without]
    assert all(
        of.low_deg <= by.low_deg and by.high_deg <= of.high_deg
        for of, by in zip(with_twins, without, strict=True)
    )


def test_twins_are_of_the_ranges_and_begin_each_with_a_history_of_its_own():
    preset, ranges = load_preset("ureteroscope"), load_ranges("ureteroscope")
    spread = []
    for from_rest in (True, False):
        found = draw_twins(preset, ranges, (2.0, 4.0), T, from_rest=from_rest)
        angles = found.twins_deg(found.start(np.array([3.0]), np.zeros(1)))
        assert angles.shape == (1, TWINS)
        spread.append(float(np.std(angles)))
    assert spread[0] < spread[1]


def test_a_step_of_the_twins_spans_the_time_that_has_passed(twins):
    """A sheath, a servo and viscosity need time: one long step is several of T."""
    begun = twins.start(np.array([2.0]), np.zeros(1))
    missing = np.full(1, np.nan)
    long = twins.over(3 * T).step(begun, np.array([3.0]), np.array([2.0]), missing)
    short = twins.step(begun, np.array([3.0]), np.array([2.0]), missing)
    assert (long.time, short.time) == (pytest.approx(3 * T), pytest.approx(T))


def test_twins_in_two_planes_are_refused():
    with pytest.raises(InputError, match="two bending planes"):
        draw_twins(
            load_preset("ureteroscope").replace(bending_planes=2),
            load_ranges("ureteroscope"),
            (2.0, 4.0),
            T,
            from_rest=True,
        )


def test_twins_of_a_file_are_those_that_it_was_trained_on(tmp_path):
    preset, ranges = load_preset("ureteroscope"), load_ranges("ureteroscope")
    held = {"preset": preset.to_dict(), "ranges": ranges.to_dict()}

    def of(description):
        return twins_of(TrainedFile(None, "ram-memory", description, tmp_path / "policy.onnx", None))

    assert of(held) == (preset, ranges)
    assert of({"agent": "ram"}) is None
    with pytest.raises(InputError, match="the twins of its training"):
        of(held | {"ranges": {"wire_stiffness": [5.0, 1.0]}})
    with pytest.raises(InputError, match="the twins of its training"):
        of(held | {"preset": {"wire_stiffness": [1.0]}})
