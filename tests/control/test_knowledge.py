"""Knowledge of controllers before a run: the nominal endoscope's, and a filter told of the sensor."""

import numpy as np
import pytest
from controlled import DEPLOYMENT, MODEL, PRESET, STROKE_MM, knowledge

from twin.control.line import fit_line


def test_the_line_is_that_of_the_preset_on_the_stroke():
    assert knowledge().line == fit_line(PRESET, STROKE_MM)
    assert knowledge(stroke_mm=(-1.0, 1.0)).line != fit_line(PRESET, STROKE_MM)


def test_the_active_model_is_that_of_the_deployment_at_the_sensor_s_rate_and_variance():
    known = knowledge(sample_time=0.02, noise_variance=2.5)
    assert known.model == MODEL
    active = known.active_model
    assert (active.sample_time, active.measurement_variance) == (0.02, 2.5)
    np.testing.assert_allclose(
        active.process_variance, np.array(DEPLOYMENT.fallback.process_variance) / 5, rtol=1e-12
    )


def test_a_trained_file_is_asked_for_where_there_is_none(tmp_path):
    assert knowledge(policy=tmp_path).trained == tmp_path
    with pytest.raises(ValueError, match="needs a trained file"):
        knowledge().trained  # noqa: B018
