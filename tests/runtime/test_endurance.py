"""A million faulty samples and ten million good ones: no exception, no NaN, every fault told, memory flat."""

import math
import resource

import numpy as np
import pytest
from assured_streams import T, assured, stream
from planted_faults import FAULTS

from twin.estimation.health import Health
from twin.runtime.reading import Alarm

FLAGS = Alarm.INPUT | Alarm.STUCK | Alarm.TIMEOUT
TURN = 1200  # samples after which the stream is the same again


def samples(first, count, pull, truth, rng):
    """Samples of a stream without end, with noise drawn anew."""
    noise = math.sqrt(0.1) * rng.standard_normal(count)
    places = np.arange(first, first + count) % TURN
    return [
        ((first + k) * T, float(pull[place]), float(truth[place] + noise[k]))
        for k, place in enumerate(places)
    ]


@pytest.mark.endurance
def test_a_million_samples_with_planted_faults():
    pull, truth, _ = stream(TURN)
    rng = np.random.default_rng(8)
    live, k, faulty, missed, good, false = assured(), 0, 0, 0, 0, 0
    while live.samples < 1_000_000 or faulty < 100_000:
        fault = FAULTS[int(rng.integers(len(FAULTS)))]
        length = int(rng.choice([4, 5, 10, 30, 100]))
        began, flagged = None, None
        for place, (sample, is_faulty) in enumerate(fault(samples(k, length, pull, truth, rng), rng)):
            reading = live.push(*sample)
            assert math.isfinite(reading.bend_deg + reading.low_deg + reading.high_deg)
            faulty += is_faulty
            began = place if is_faulty and began is None else began
            if began is not None and flagged is None:
                flagged = place if reading.health is not Health.GOOD or reading.alarms & FLAGS else None
        missed += began is not None and (flagged is None or flagged - began >= 3)
        k += length
        for number, sample in enumerate(samples(k, 150, pull, truth, rng)):
            reading = live.push(*sample)
            if number > 100:  # behind what a fault has left
                good += 1
                false += reading.health is not Health.GOOD or reading.alarms is not Alarm.NONE
        k += 150
    print(f"{live.samples} samples, {faulty} faulty: {missed} faults not told; {false} flags in {good} good")
    assert missed == 0
    assert false <= good / 1e5 + 1


@pytest.mark.endurance
def test_memory_is_flat_over_ten_million_samples():
    pull, truth, _ = stream(TURN)
    rng = np.random.default_rng(8)
    live, used = assured(), []
    for block in range(100):
        for sample in samples(100_000 * block, 100_000, pull, truth, rng):
            live.push(*sample)
        used.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    print(f"{live.samples} samples: {used[10]:.1f} MiB after a tenth, {used[-1]:.1f} MiB at the end")
    assert used[-1] - used[10] < 2
