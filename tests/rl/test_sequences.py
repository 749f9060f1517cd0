"""Sequences of the training on twins: which sample times are met, and how often."""

import dataclasses

import numpy as np
import pytest
from small_twins import TINY, generator, small_source, small_step

from rl.twins.learning import validation
from rl.twins.records import STRIDES, SequenceSource


@pytest.mark.parametrize(
    ("strides", "shares"), [(STRIDES, (0.7, 0.15, 0.15)), ((1, 5), (0.7, 0.3)), ((2,), (1.0,))]
)
def test_the_first_sample_time_is_met_most_often_and_the_others_alike(strides, shares):
    source, rng = dataclasses.replace(small_source(), strides=strides), generator(3)
    drawn = [source.draw(1, 10, rng).stride for _ in range(600)]
    met = [drawn.count(stride) / len(drawn) for stride in strides]
    assert sum(met) == pytest.approx(1)
    np.testing.assert_allclose(met, shares, atol=4 * np.sqrt(0.25 / len(drawn)))


def test_validation_is_at_the_ends_of_what_is_met(monkeypatch):
    met, draw = [], SequenceSource.draw

    def recorded(source, count, samples, rng, stride=None):
        met.append(stride)
        return draw(source, 4, samples, rng, stride)

    monkeypatch.setattr(SequenceSource, "draw", recorded)
    validation(small_step(), dataclasses.replace(small_source(), strides=(1, 2)), TINY)
    assert met == [2, 1]


def test_each_sequence_has_what_is_left_of_the_zero_of_the_sensor():
    source = dataclasses.replace(small_source(("gaussian",)), zero_deviation_deg=2.0)
    met = source.draw(400, 200, generator(4), stride=1)
    mean = (met.measurement_deg - met.truth_deg).mean(dim=0)
    assert float(met.bias_deg.std()) == pytest.approx(2.0, rel=0.15)
    off = (mean - met.bias_deg) / (met.variance / 200).sqrt()
    assert float(off.std()) == pytest.approx(1.0, rel=0.15)
