"""Companions of a trained file: the fallback is tuned well, and the limits are those of the records."""

import dataclasses
import itertools

import numpy as np
import pytest
from models import COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment, log_likelihoods, prepare_deployment, tune_fallback
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.tuning import draw_training_episodes, innovation_log_likelihood, tune_active_model
from twin.hysteresis import BoucWen
from twin.identification.nominal import LEAST_PER_MM, identify_steps


@pytest.fixture(scope="module")
def short(records):
    return [(pull[:80], bend[:80]) for pull, bend in records]


def episodes(records, seed=1):
    return draw_training_episodes(TrainingTask(*stack_records(records)), seed, 8)[:3]


def test_the_likelihood_of_many_is_that_of_each(short):
    variances = np.array([[1e-3, 1e-2, 100.0, 1.0], [1e-1, 1e-4, 3.0, 10.0]])
    start = ActiveModel(COLEMAN_HODGDON, 0.1)
    expected = [
        innovation_log_likelihood(
            dataclasses.replace(start, process_variance=tuple(row[:2]), initial_variance=tuple(row[2:])),
            *episodes(short),
        )
        for row in variances
    ]
    np.testing.assert_allclose(log_likelihoods(start, variances, *episodes(short)), expected, rtol=1e-9)


def test_the_fallback_is_as_likely_as_that_of_a_slower_search(short):
    start = ActiveModel(COLEMAN_HODGDON, 0.1)
    found = tune_fallback(start, short, seed=1)
    slower = tune_active_model(start, *episodes(short))
    fast, slow = (innovation_log_likelihood(filter_, *episodes(short)) for filter_ in (found, slower))
    assert fast > slow - 2


def test_limits_lie_a_tenth_beyond_the_records(short):
    deployment = prepare_deployment(short, COLEMAN_HODGDON, 0.1, 1)
    pulls = np.concatenate([pull for pull, _ in short])
    width = pulls.max() - pulls.min()
    np.testing.assert_allclose(deployment.pull_mm, (pulls.min() - width / 10, pulls.max() + width / 10))
    fastest = max(np.abs(np.diff(pull)).max() for pull, _ in short) / 0.1
    np.testing.assert_allclose(deployment.pull_speed_mm_s, 1.1 * fastest)


def test_it_travels_as_plain_values(short):
    deployment = prepare_deployment(short, COLEMAN_HODGDON, 0.1, 1)
    assert Deployment.from_dict(deployment.to_dict()) == deployment


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"fallback": 3}, "fallback"),
        ({"pull_mm": [1.0]}, "pull_mm"),
        ({"pull_speed_mm_s": -1.0}, "pull_speed_mm_s"),
        ({"bend_deg": [0.0, float("nan")]}, "bend_deg"),
    ],
)
def test_a_wrong_part_is_named(short, change, fault):
    values = prepare_deployment(short, COLEMAN_HODGDON, 0.1, 1).to_dict() | change
    with pytest.raises(ValueError, match=fault):
        Deployment.from_dict(values)


def test_a_fallback_on_another_model_is_refused(short):
    values = prepare_deployment(short, COLEMAN_HODGDON, 0.1, 1).to_dict()
    values["fallback"] = ActiveModel(BoucWen(22.0, -15.0, 1.2, 1.5, 2.0), 0.1).to_dict()
    with pytest.raises(ValueError, match="must be coleman-hodgdon"):
        Deployment.from_dict(values)


def test_steps_of_a_model_give_its_parameters_back():
    pull = 3 + np.sin(np.arange(500) * 0.07)
    found = identify_steps([(pull, COLEMAN_HODGDON.response(pull, 60.0))])
    for name in ("a_per_mm", "b_deg_per_mm", "c_deg_per_mm"):
        np.testing.assert_allclose(getattr(found, name), getattr(COLEMAN_HODGDON, name), rtol=1e-9)


def test_steps_that_bend_the_other_way_give_the_slowest_model():
    pull, bend = 3 + np.sin(np.arange(500) * 0.07), [0.0]
    for before, after in itertools.pairwise(pull):
        bend.append(bend[-1] - 0.02 * abs(after - before) * (10 * after - bend[-1]) + 2 * (after - before))
    found = identify_steps([(pull, np.array(bend))])
    assert found.a_per_mm == pytest.approx(LEAST_PER_MM)
    assert found.b_deg_per_mm > 0
