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
