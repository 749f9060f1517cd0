"""Fitted parameters: their choice, and the numbers of the search that presets become."""

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH, loops, recorded

from twin.calibration import free_parameters, measured_loop
from twin.calibration.parameters import DEFAULT
from twin.episode import Episode


def test_scale_of_forces_is_not_searched_without_load_cells():
    episode = recorded()
    blind = Episode(**(vars(episode) | {"wire_tension": np.empty((len(episode.time), 2, 0))}))
    loop = measured_loop(blind, "blind", SAMPLE_TIME)
    names = free_parameters(TRUTH, [loop]).names
    assert "section_stiffness" not in names
    assert "pretension" in names
    assert set(names) < set(DEFAULT)
    assert "section_stiffness" in free_parameters(TRUTH, loops(0.0, 1.0)).names


def test_numbers_of_the_search_and_presets_are_the_same_thing():
    free = free_parameters(TRUTH.replace(initial_bend=-0.1), loops(0.0, 1.0))
    again = free.encode(free.decode(free.start))
    np.testing.assert_allclose(again, free.start, atol=1e-12)
    assert (free.lower < free.start).all()
    assert (free.start < free.upper).all()
    outside = free.decode(free.upper + 1)
    np.testing.assert_allclose(free.encode(outside), free.upper, atol=1e-9)


@pytest.mark.parametrize(
    ("names", "rule"),
    [
        (("stiffness",), "unknown preset parameter 'stiffness'"),
        (("vertebrae",), "cannot be fitted"),
        (("time_step",), "cannot be fitted"),
        (("gravity_z",), "no scale"),
        (("pretension", "pretension"), "named twice"),
        (("friction_wear",), "is 0 in the preset"),
    ],
)
def test_parameter_that_cannot_be_fitted_is_refused(names, rule):
    with pytest.raises(ValueError, match=rule):
        free_parameters(TRUTH, loops(0.0), names)
