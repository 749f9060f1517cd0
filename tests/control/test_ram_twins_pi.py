"""PI on the estimate of RAM (twins): it believes what the trained file says of its own commands."""

import numpy as np
from controlled import R, T, closed_loop, knowledge

from twin.control.controllers.feedback import RAM_TWINS_PI
from twin.control.trial import Plant
from twin.estimation.estimator import Sensor
from twin.estimation.learned.ram_twins import load


def test_it_believes_the_trained_file_at_the_r_of_the_sensor(twins_policy):
    known = knowledge(policy=twins_policy)
    plant, rng = Plant(known.preset, T, "reduced"), np.random.default_rng(2)
    plant.start(0.0)
    wanted = 40 * np.sin(np.arange(150) * 0.05)
    noise = rng.normal(0, R**0.5, len(wanted))
    course = closed_loop(RAM_TWINS_PI.make(known), plant.step, wanted, lambda k, bend: bend + noise[k])
    told = load(twins_policy).with_sensor(Sensor(R))
    expected = told.estimate(course.pull_mm, course.bend_deg + noise, 0.0)[0]
    np.testing.assert_allclose(course.believed_deg, expected, atol=1e-6)
    assert np.sqrt(np.mean((course.believed_deg - course.bend_deg)[20:] ** 2)) < 1.0
