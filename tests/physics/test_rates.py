"""Any time between samples: the twins are stepped in between, and their bend does not depend on it."""

import numpy as np
import pytest

from twin.preset import load_preset
from twin.preset.preset import at_sample_time
from twin.reduced import ReducedTwins
from twin.simulation import PHYSICS, simulate, simulate_batch

PRESET = load_preset("ureteroscope")
RATES_HZ = (30, 59.94, 60, 100, 120)


def pull_at(time):
    return 3e-3 * np.sin(2 * np.pi * time / 4)


@pytest.mark.parametrize("physics", PHYSICS)
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_the_bend_does_not_depend_on_the_rate(physics, rate_hz):
    time, often = np.arange(0, 5, 1 / rate_hz), np.arange(0, 5.01, 0.02)
    reference = simulate(PRESET, pull_at(often), 0.02, physics=physics)
    record = simulate(PRESET, pull_at(time), 1 / rate_hz, physics=physics)
    assert record.metadata["preset"]["control_period"] <= PRESET.control_period
    expected = np.interp(time, often, reference.truth_deg)
    np.testing.assert_allclose(record.truth_deg, expected, atol=3e-3 * np.ptp(expected))
    (of_batch,) = simulate_batch([PRESET], [pull_at(time)], 1 / rate_hz, physics=physics)
    np.testing.assert_array_equal(of_batch.bend, record.bend)


def test_twins_that_are_stepped_follow_the_record_at_any_rate():
    time = np.arange(0, 2, 1 / 30)
    record = simulate(PRESET, pull_at(time), 1 / 30, physics="reduced")
    twins = ReducedTwins([PRESET], 1 / 30)
    bends = [float(twins.step(pull)[0]) for pull in pull_at(time)]
    np.testing.assert_allclose(bends, record.bend, atol=1e-9)


def test_a_period_that_divides_the_sample_is_kept_and_another_becomes_a_little_shorter():
    assert at_sample_time(PRESET, 0.1) is PRESET
    changed = at_sample_time(PRESET, 1 / 30)
    assert changed.control_period == pytest.approx(1 / 120)
    assert changed.time_step <= PRESET.time_step
    assert at_sample_time(changed, 1 / 30) is changed
