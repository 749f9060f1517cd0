"""Statistics of what is exported, seen in parts, against those of NumPy over the whole."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from twin.export.statistics import BINS, QUANTILES, Histogram, RunningStatistics, exact_statistics

numbers = st.floats(-1e6, 1e6, width=32) | st.sampled_from([0.0, 1.0, -1e-7, 1e-9, 3e8 + 0.25])
records = st.lists(arrays(float, st.tuples(st.integers(1, 30), st.just(2)), elements=numbers), max_size=6)


@given(records.filter(bool), st.randoms())
@example([np.zeros((4, 2)), np.full((3, 2), 1e-6)], None)
@example([np.full((2, 2), 1e9), np.full((2, 2), 1e9 + 1e-6)], None)
def test_statistics_seen_in_parts_are_those_of_the_whole_in_any_order(parts, order):
    if order is not None:
        order.shuffle(parts)
    running = RunningStatistics(2)
    for part in parts:
        running.add(part)
    told, values = running.result(), np.concatenate(parts)
    size = np.abs(values).max() + 1e-300
    for key, wanted in exact_statistics(values).items():
        of_a_bin = 2.1 * np.ptp(values) / (BINS - 2) if key in QUANTILES else 0
        np.testing.assert_allclose(told[key], wanted, rtol=0, atol=of_a_bin + 1e-12 * size)


def test_deviation_is_right_where_the_mean_is_large_beside_it():
    values = 1e8 + np.random.default_rng(0).normal(size=(4000, 1))
    running = RunningStatistics(1)
    for part in np.split(values, 40):
        running.add(part)
    assert running.result()["std"][0] == pytest.approx(values.std(), rel=1e-9)


def test_a_histogram_stays_small_and_finds_quantiles_that_numpy_finds():
    rng = np.random.default_rng(1)
    parts = [rng.normal(size=500) * 10.0**power for power in range(-6, 5)]
    histogram = Histogram()
    for part in parts:
        histogram.add(part)
    values = np.concatenate(parts)
    shares = np.linspace(0, 1, 41)
    error = np.abs(histogram.quantiles(shares.tolist()) - np.quantile(values, shares))
    assert error.max() <= 2 * np.ptp(values) / (BINS - 2)
    assert len(histogram._counts) <= BINS
    assert histogram._counts.sum() == len(values)
