"""Sequences of the training on twins: which sample times are met, and how often."""

import dataclasses

import numpy as np
import pytest
from small_twins import TINY, generator, small_members, small_records, small_source, small_step

from rl.twins.learning import validation
from rl.twins.records import (
    CALIBRATED,
    CHANGED,
    SAMPLE_TIME,
    STRIDES,
    WRONG,
    SequenceSource,
    draw_situations,
    knock,
    sticking,
)
from twin.reduced import simulate


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


def test_zeros_are_as_far_off_as_is_stated_and_noise_has_mean_zero_about_them():
    met = small_source(("gaussian",)).draw(3000, 200, generator(4), stride=1)
    known = met.zero_deviation_deg == 0
    assert float(known.float().mean()) == pytest.approx(CALIBRATED, abs=0.04)
    assert (met.bias_deg[known] == 0).all()
    scaled = met.bias_deg[~known] / met.zero_deviation_deg[~known]
    assert float(scaled.std()) == pytest.approx(1.0, rel=0.06)
    ordinary = met.linear == 1
    off = (met.measurement_deg - met.truth_deg - met.bias_deg).mean(dim=0) / (met.variance / 200).sqrt()
    assert float(off[ordinary].std()) == pytest.approx(1.0, rel=0.06)


def test_a_wrong_variance_and_a_changed_noise_are_met_as_often_as_stated():
    """Where the noise changes, all of it is drawn; where R is wrong, the noise has another variance."""
    noise = draw_situations(("gaussian", "gamma"), 4000, 400, generator(5))
    shares = [float((noise.family == 2 + place).mean()) for place in range(2)]
    np.testing.assert_allclose(shares, [WRONG, CHANGED], atol=0.02)
    ratio = noise.noise_deg.var(axis=1) / noise.variance
    assert (np.abs(np.log(ratio[noise.family == 2])) > 0.3).mean() > 0.5
    assert (np.abs(np.log(ratio[noise.family < 2])) < 0.6).mean() > 0.97
    assert not noise.linear[noise.family >= 2].any()


def test_a_drive_that_sticks_lags_by_no_more_than_its_band_and_a_knock_decays():
    pull = 2e-3 * np.sin(np.linspace(0, 20, 2000))
    moved = sticking(pull, generator(1))
    assert 0.05e-3 < np.abs(moved - pull).max() <= 0.3e-3
    assert len(np.unique(moved)) < 400
    added = knock(pull, generator(2))
    begins = int(np.flatnonzero(added)[0])
    assert begins >= len(pull) // 6
    assert 0.5 <= np.abs(added[begins]) <= 4.0
    assert np.abs(added[-1]) < np.abs(added[begins])


def test_before_some_commands_twins_have_moved_each_on_its_own():
    """From rest, members are those of the reduced twin along the command; else they begin off it."""
    pull_mm, members_deg, _ = small_records()
    records = [
        simulate(small_members().presets[0], pull.astype(float) * 1e-3, SAMPLE_TIME).truth_deg
        for pull in pull_mm
    ]
    off = np.abs(members_deg[:, 0] - np.array(records))
    from_rest = off.max(axis=1) < 2e-3
    assert from_rest.any()
    assert (off[~from_rest, 0] > 0.2).any()
    assert np.abs(pull_mm).max() <= 4
