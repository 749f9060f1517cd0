"""Knowledge of controllers before a run: the nominal endoscope's, and a filter told of the sensor."""

import numpy as np
from controlled import DEPLOYMENT, MODEL, knowledge


def test_the_active_model_is_that_of_the_deployment_at_the_sensor_s_rate_and_variance():
    known = knowledge(sample_time=0.02, noise_variance=2.5)
    assert known.model == MODEL
    active = known.active_model
    assert (active.sample_time, active.measurement_variance) == (0.02, 2.5)
    np.testing.assert_allclose(
        active.process_variance, np.array(DEPLOYMENT.fallback.process_variance) / 5, rtol=1e-12
    )
