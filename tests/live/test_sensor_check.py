"""The check of the sensor, on simulated endoscopes that are none of its twins."""

import numpy as np
import pytest

from twin.live.reading import Alarm
from twin.live.sensor_check import SensorCheck, fault_of
from twin.preset import load_preset, load_ranges
from twin.reduced import simulate_batch
from twin.signals.excitation import command

T, R, SECONDS = 0.1, 0.1, 75.0
SAMPLES = round(SECONDS / T)
TWINS, OTHERS = 24, 4
BEGINS, ENDS = 400, 550  # samples between which a sensor is wrong


def angles(presets, pull):
    return np.array([episode.truth_deg for episode in simulate_batch(presets, [pull] * len(presets), T)])


@pytest.fixture(scope="module")
def endoscopes():
    """Pull [mm], angles of twins (N, M) and of other endoscopes (OTHERS, N) along it [deg]."""
    preset, ranges, rng = load_preset("ureteroscope"), load_ranges("ureteroscope"), np.random.default_rng(3)
    pull = command("sine", (-3e-3, 3e-3), SECONDS, T, rng)
    drawn = [ranges.draw(preset, rng) for _ in range(TWINS + OTHERS)]
    bent = angles(drawn, pull)
    return pull * 1e3, bent[:TWINS].T, bent[TWINS:]


def run(endoscopes, measured, *, zero_deviation=2.0):
    """Return alarms, predictions and half of their intervals (N,)."""
    pull, twins, _ = endoscopes
    check = SensorCheck(twins.shape[1], T, R, zero_deviation)
    way = np.abs(np.diff(pull, prepend=pull[0]))
    found = []
    for k, measurement in enumerate(measured):
        check.push(twins[k], way[k], measurement, T)
        found.append((check.alarm, *check.prediction()))
    alarms, bend, half_width = (np.array(of) for of in zip(*found, strict=True))
    return [Alarm(int(of)) for of in alarms], bend, half_width


def noise(seed=0, count=SAMPLES):
    return np.sqrt(R) * np.random.default_rng(seed).standard_normal(count)


@pytest.mark.parametrize("zero", [0.0, 3.0])
@pytest.mark.parametrize("other", range(OTHERS))
def test_a_healthy_sensor_is_believed(endoscopes, other, zero):
    truth = endoscopes[2][other]
    alarms, bend, half_width = run(endoscopes, truth + zero + noise(other))
    assert not any(alarms)
    assert np.mean(np.abs(bend - truth)[150:] <= half_width[150:]) > 0.9


def test_outliers_are_no_fault(endoscopes):
    truth, rng = endoscopes[2][0], np.random.default_rng(1)
    far = rng.choice([-30.0, 30.0], len(truth)) * (rng.random(len(truth)) < 0.05)
    assert not any(run(endoscopes, truth + noise() + far)[0])


def test_measurements_that_are_missing_are_no_fault(endoscopes):
    measured = endoscopes[2][0] + noise()
    measured[BEGINS:ENDS] = np.nan
    assert not any(run(endoscopes, measured)[0])


FAULTS = {
    Alarm.STUCK: lambda truth, noise: truth[0] + noise,
    Alarm.SIGN: lambda truth, noise: noise - truth,
    Alarm.GAIN: lambda truth, noise: 0.7 * truth + noise,
    Alarm.DRIFT: lambda truth, noise: truth + noise + 3 * T * np.arange(len(truth)),
}


@pytest.mark.parametrize("other", range(OTHERS))
@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_wrong_sensor_is_named_and_the_twins_predict_meanwhile(endoscopes, fault, other):
    pull, _, others = endoscopes
    truth = others[other]
    wrong = slice(BEGINS, ENDS)
    measured = truth + noise(other)
    measured[wrong] = FAULTS[fault](truth[wrong], noise(other + 9)[wrong])
    alarms, bend, half_width = run(endoscopes, measured)
    assert not any(alarms[:BEGINS])
    first = next(k for k, alarm in enumerate(alarms) if alarm)
    way = np.abs(np.diff(pull[BEGINS:])).cumsum()
    assert first - BEGINS <= np.argmax(way > 2.0) + 3 / T
    assert alarms[ENDS - 1] is fault
    meanwhile = slice(first, ENDS)
    assert np.mean(np.abs(bend - truth)[meanwhile] <= half_width[meanwhile]) > 0.85
    assert np.abs(bend - truth)[meanwhile].max() < 0.2 * np.abs(measured - truth)[meanwhile].max()
    assert not any(alarms[-20:])


def test_a_zero_that_has_moved_is_taken_for_the_new_one(endoscopes):
    truth = endoscopes[2][1]
    measured = truth + noise()
    measured[300:] += 12.0
    alarms, bend, _ = run(endoscopes, measured, zero_deviation=0.0)
    assert Alarm.BIAS in alarms
    assert not any(alarms[-100:])
    assert np.abs(bend - truth)[-100:].max() < 3


def test_a_sensor_that_agrees_where_nothing_moves_is_used_again(endoscopes):
    """A controller holds its command while the sensor is wrong."""
    pull, twins, others = endoscopes
    truth = others[2].copy()
    pull, twins = pull.copy(), twins.copy()
    held = slice(ENDS - 20, None)
    pull[held], twins[held], truth[held] = pull[ENDS - 20], twins[ENDS - 20], truth[ENDS - 20]
    measured = truth + noise()
    measured[BEGINS:ENDS] = -truth[BEGINS:ENDS]
    alarms, *_ = run((pull, twins, others), measured)
    assert alarms[ENDS - 1] is Alarm.SIGN
    assert not any(alarms[ENDS + 130 :])


def test_twins_that_never_fitted_are_no_witnesses(endoscopes):
    """Another kind of endoscope: its sensor is right."""
    pull, _, _ = endoscopes
    (truth,) = angles([load_preset("vio_com")], pull * 1e-3)
    assert not any(run(endoscopes, 3 * truth + noise())[0])


def test_a_fault_keeps_its_name_until_another_is_clearly_better():
    time = np.arange(50.0)
    predicted = 30 + 10 * np.sin(time)
    points = np.stack([time, predicted, 0.8 * predicted], axis=1)
    assert fault_of(points, Alarm.STUCK) is Alarm.GAIN
    still = np.stack([time, np.full(50, 30.0), 20 + noise(count=50)], axis=1)
    named = {fault_of(still, before) for before in (Alarm.STUCK, Alarm.GAIN, Alarm.BIAS)}
    assert named == {Alarm.STUCK, Alarm.GAIN, Alarm.BIAS}
