"""Runs of a method on a case: estimates and intervals of all, innovations of the first draws."""

import numpy as np
import pytest
from scores import simulated_record

from twin.estimation.active_model import ActiveModel
from twin.estimation.open_loop import OpenLoop
from twin.evaluation.method import as_method, make_case, runs_of, with_innovations
from twin.evaluation.protocol import PAPER_CONDITIONS, Protocol
from twin.hysteresis import ColemanHodgdon

FIRST, EVERY = 10, 5


@pytest.fixture(params=[1, 3], ids=["one draw", "three draws"])
def seeds(request):
    return request.param


@pytest.fixture
def case(records, seeds):
    made = [(number, simulated_record(pull, bend)) for number, (pull, bend) in enumerate(records[:2])]
    return make_case(made, Protocol("paper-only", seeds))


def samples_of(case):
    return range(FIRST, case.pull_mm.shape[1], EVERY)


def test_first_draws_are_one_of_each_noise_on_each_record(case, seeds):
    once = np.arange(len(case.pull_mm)) % seeds == 0
    assert once.sum() == 2 * len(PAPER_CONDITIONS)
    chosen = runs_of(case, once)
    assert chosen.noises == tuple(case.noises[::seeds])
    assert len(set(zip(chosen.noises, chosen.pull_mm[:, 5], strict=True))) == once.sum()
    assert chosen.truth_deg is None
    np.testing.assert_array_equal(chosen.measurement_deg, case.measurement_deg[::seeds])
    np.testing.assert_array_equal(chosen.sensor.variance, np.asarray(case.sensor.variance)[::seeds])


def test_innovations_of_the_first_draws_change_no_estimate(model, case, seeds):
    estimator = ActiveModel(model, 0.1)
    (ran,) = as_method("AM", estimator).run(case, seeds, samples_of(case))
    stated = estimator.with_sensor(case.sensor)
    of_case = case.pull_mm, case.measurement_deg, case.initial_bend_deg
    bend, half_width = stated.estimate_with_interval(*of_case)
    np.testing.assert_allclose(ran.bend_deg, bend, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ran.half_width_deg, half_width, rtol=0, atol=1e-9)
    variance = np.broadcast_to(case.sensor.variance, len(bend))
    initial = np.asarray(case.initial_bend_deg)
    squares = with_innovations(
        stated, case.pull_mm.T, case.measurement_deg.T, initial, variance, samples_of(case)
    )[2]
    np.testing.assert_allclose(ran.nis, np.nanmean(squares, axis=0)[::seeds], rtol=1e-9)


def test_what_states_no_interval_has_no_innovations(case, seeds):
    (ran,) = as_method("C-H", OpenLoop(ColemanHodgdon(1.0, 20.0, 5.0))).run(case, seeds, samples_of(case))
    assert ran.half_width_deg is None
    assert ran.nis is None
    assert ran.bend_deg.shape == case.measurement_deg.shape
