"""What the study of wrong sensors counts, on an estimator whose readings are known."""

import numpy as np
import pytest

from scripts.studies.sensor_faults import GOOD_S, NONE, WRONG_S, row, run_fault
from twin.gate.stream import FAULTS
from twin.live.reading import Alarm, Health, Reading, Source

T = 0.1
TIME = np.arange(round(85 / T)) * T
PULL, TRUTH = 3 + np.sin(TIME), 60 + 20 * np.sin(TIME)
FLIPPED = next(fault for fault in FAULTS if fault.name == "sensor of the wrong sign")


class Follower:
    """Repeats the measurement, and raises an alarm from a time on."""

    def __init__(self, alarm_s):
        self.alarm_s = alarm_s

    def push(self, time_s, pull_mm, measurement_deg):
        alarm = Alarm.SIGN if GOOD_S + self.alarm_s <= time_s < GOOD_S + WRONG_S else Alarm.NONE
        low, high = measurement_deg - 1, measurement_deg + 1
        return Reading(measurement_deg, low, high, Source.ADVANCED, Health.GOOD, alarm)


@pytest.mark.parametrize(("alarm_s", "in_time"), [(0.5, True), (15.0, False)])
def test_alarms_and_errors_are_those_of_the_fault(alarm_s, in_time):
    outcome = run_fault(Follower(alarm_s), FLIPPED, PULL, TRUTH, TRUTH, T)
    wrong = slice(round(GOOD_S / T), round((GOOD_S + WRONG_S) / T))
    assert outcome.matters
    assert outcome.in_time is in_time
    assert outcome.false == 0
    assert outcome.square == pytest.approx(np.mean((2 * TRUTH[wrong]) ** 2))
    assert outcome.largest_deg == pytest.approx(2 * TRUTH[wrong].max())
    assert outcome.inside == outcome.square_after == 0.0
    assert row("flipped", [outcome])[1:3] == (["100%", "100% of 1"] if in_time else ["0%", "0% of 1"])


def test_without_a_fault_nothing_matters_and_an_early_alarm_is_false():
    outcome = run_fault(Follower(-1.0), NONE, PULL, TRUTH, TRUTH, T)
    assert (outcome.matters, outcome.false, outcome.square) == (False, round(1 / T), 0.0)
    assert outcome.inside == 1.0
    assert row("none", [outcome])[2] == "-"
