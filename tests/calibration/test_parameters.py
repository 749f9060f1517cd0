"""Fitted parameters: their choice, their first guess, and the numbers of the search."""

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH, changed, loops, recorded

from twin.calibration import MeasuredLoop, free_parameters, measured_loop
from twin.calibration.parameters import DEFAULT, FROM_NOTHING, first_guess
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


def held(pull, bend, difference):
    """Return a log in which wires pull with a difference of their tensions [N]."""
    tension = 5.0 + np.stack([difference, -difference], axis=1) / 2
    everything = np.ones(len(pull), bool)
    nothing, time = np.empty((len(pull), 2, 0)), SAMPLE_TIME * np.arange(len(pull))
    episode = Episode(time, pull, bend, bend, nothing[:, 0], tension[..., None], nothing)
    return MeasuredLoop("held", episode, everything, everything)


def test_first_guess_tells_stretched_wires_from_a_wide_section():
    turn = np.linspace(0, 4 * np.pi, 200)
    bend, difference = 0.3 * np.sin(turn) + 0.1, 4.0 * np.sin(turn - 0.2)
    loop = held(6e-3 * bend + difference / (2 * 400.0), bend, difference)
    guess = first_guess(TRUTH, [loop])
    assert guess["wire_offset"] == pytest.approx(6e-3)
    assert guess["wire_stiffness"] == pytest.approx(400.0)


def test_without_load_cells_no_force_is_guessed():
    bend = np.linspace(0, 1, 200)
    blind = changed(held(5e-3 * bend, bend, bend), tension=np.empty((200, 0)))
    guess = first_guess(TRUTH, [blind])
    assert guess.pop("wire_offset") == pytest.approx(5e-3)
    assert guess == {name: value for name, value in FROM_NOTHING.items() if getattr(TRUTH, name) == 0}
