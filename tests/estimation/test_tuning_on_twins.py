"""Filters that are tuned on twins: likelier on twins of other draws than those of one endoscope."""

import dataclasses

import numpy as np
import pytest

from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_method
from twin.estimation.tuning import (
    INITIAL_ERROR_DEG,
    STROKE_MM,
    TUNED,
    TWINS,
    VARIANCES_DEG2,
    TwinsLikelihoodFit,
    draw_twin_episodes,
    innovation_log_likelihood,
)
from twin.hysteresis import ColemanHodgdon
from twin.preset import load_preset, load_ranges

MODEL = ColemanHodgdon(1.15, 22.3, 4.9)
FIT = TwinsLikelihoodFit("coleman-hodgdon, on twins", ColemanHodgdon.name)


def knowledge(seed=1, sample_time=0.1):
    twins = load_preset("ureteroscope"), load_ranges("ureteroscope")
    record = MODEL_RECORD
    return Knowledge(sample_time, {ColemanHodgdon.name: MODEL}, records=[record], seed=seed, twins=twins)


_PULL = 3 + np.sin(np.linspace(0, 40, 300))
MODEL_RECORD = (_PULL, MODEL.response(_PULL, 0.0))


def test_episodes_are_of_many_twins_under_noise_of_the_stated_variance():
    episodes, variance = draw_twin_episodes(knowledge())
    assert episodes.pull_mm.shape == episodes.bend_deg.shape
    assert len(variance) == TWINS
    assert STROKE_MM[0] <= episodes.pull_mm.min() < episodes.pull_mm.max() <= STROKE_MM[1]
    assert (variance >= VARIANCES_DEG2[0]).all()
    assert (variance <= VARIANCES_DEG2[1]).all()
    found = np.var(episodes.measurement_deg - episodes.bend_deg, axis=1)
    np.testing.assert_allclose(found, variance, rtol=0.3)
    assert np.abs(episodes.initial_bend_deg - episodes.bend_deg[:, 0]).max() <= INITIAL_ERROR_DEG
    finer, _ = draw_twin_episodes(knowledge(sample_time=0.02))
    np.testing.assert_array_equal(finer.bend_deg[:, ::5], episodes.bend_deg)


@pytest.mark.slow
def test_it_is_likelier_on_other_twins_than_a_filter_tuned_on_one_endoscope():
    known, other = knowledge(), knowledge(seed=2)
    episodes, variance = draw_twin_episodes(other)
    likelihoods = []
    for fit in (FIT, TUNED):
        found = fit.find(known)
        filter_ = ActiveModel(
            MODEL,
            0.1,
            process_variance=tuple(found["process_variance"]),
            initial_variance=tuple(found["initial_variance"]),
            measurement_variance=variance,
        )
        likelihoods.append(innovation_log_likelihood(filter_, *episodes[:3]))
    assert likelihoods[0] > likelihoods[1] + 1000


def test_it_is_compared_where_it_is_named_and_needs_twins():
    spec = find_method("AM-tuned (twins)")
    assert spec.presentation.on_request
    assert spec.given == ("R", "ranges")
    with pytest.raises(ValueError, match="needs a preset and its ranges"):
        FIT.find(dataclasses.replace(knowledge(), twins=None))
