"""PI on the estimate of the active model: it believes what the tuned filter says of its own commands."""

import numpy as np
import pytest
from controlled import DEPLOYMENT, MODEL, STROKE_MM, R, T, closed_loop, knowledge

from twin.control.controllers.feedback import ACTIVE_MODEL_PI
from twin.estimation.active_model import ActiveModel


def course(sample_time=T, variance=R, seed=1):
    known = knowledge(sample_time=sample_time, noise_variance=variance)
    rng = np.random.default_rng(seed)
    wanted = 30 * np.sin(np.arange(300) * 0.05)
    bend = [0.0, 0.0]

    def plant(pull: float) -> float:  # the model of its filter, and a drift
        (bend[0],), _ = MODEL.step(np.array([bend[0]]), np.empty(0), pull, bend[1])
        bend[1] = pull
        return bend[0] + 4.0

    return closed_loop(
        ACTIVE_MODEL_PI.make(known), plant, wanted, lambda k, of: of + rng.normal(0, variance**0.5)
    ), rng


@pytest.mark.parametrize(("sample_time", "variance"), [(T, R), (T, 4.0), (0.02, R)])
def test_it_believes_the_filter_that_was_tuned_with_q_of_its_sample_time_and_the_r_of_the_sensor(
    sample_time, variance
):
    followed, _ = course(sample_time, variance)
    q_bend, q_error = DEPLOYMENT.fallback.process_variance
    share = sample_time / T
    tuned = ActiveModel(MODEL, sample_time, (q_bend * share, q_error * share), variance, (100.0, 1.0))
    rng = np.random.default_rng(1)
    measured = np.array([of + rng.normal(0, variance**0.5) for of in followed.bend_deg])
    expected = tuned.estimate(followed.pull_mm, measured, 0.0)[0]
    np.testing.assert_allclose(followed.believed_deg, expected, atol=1e-6)


def test_its_stream_has_the_sample_time_of_the_run():
    """Else it would fill a gap with samples of another length."""
    controller = ACTIVE_MODEL_PI.make(knowledge(sample_time=0.02))
    controller.start(0.0, 0.0)
    assert controller.estimator.sample_time == 0.02


def test_what_the_model_does_not_know_is_fed_back():
    followed, _ = course()
    wanted = 30 * np.sin(np.arange(300) * 0.05)
    assert np.abs(followed.bend_deg - wanted)[100:].mean() < 2.0
    assert np.ptp(followed.pull_mm) < np.ptp(STROKE_MM)
