"""First guess of a calibration: what the logs show without friction."""

import dataclasses

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH

from twin.calibration import MeasuredLoop
from twin.calibration.parameters import FROM_NOTHING, first_guess


def held(pull, bend, difference):
    """Return a log in which wires pull with a difference of their tensions [N]."""
    tension = 5.0 + np.stack([difference, -difference], axis=1) / 2
    everything = np.ones(len(pull), bool)
    return MeasuredLoop("held", SAMPLE_TIME, pull, bend, tension, 0.0, everything, everything)


def test_first_guess_tells_stretched_wires_from_a_wide_section():
    turn = np.linspace(0, 4 * np.pi, 200)
    bend, difference = 0.3 * np.sin(turn) + 0.1, 4.0 * np.sin(turn - 0.2)
    loop = held(6e-3 * bend + difference / (2 * 400.0), bend, difference)
    guess = first_guess(TRUTH, [loop])
    assert guess["wire_offset"] == pytest.approx(6e-3)
    assert guess["wire_stiffness"] == pytest.approx(400.0)


def test_first_guess_is_that_of_stiff_wires_where_the_load_cells_contradict():
    bend = np.linspace(0, 1, 200)
    loop = held(5e-3 * bend, bend, -bend)
    guess = first_guess(TRUTH, [loop])
    assert guess["wire_offset"] == pytest.approx(5e-3)
    assert guess["wire_stiffness"] == pytest.approx(0.5 / 5e-3)


def test_a_window_that_stands_still_tells_nothing():
    bend = np.linspace(0, 1, 200)
    moving = held(5e-3 * bend, bend, bend)
    still = held(0 * bend, 3 * bend, bend)
    assert first_guess(TRUTH, [still, moving]) == pytest.approx(first_guess(TRUTH, [moving]))


def test_a_coarse_sensor_tells_the_distance_of_the_wires_by_its_range():
    """Its angle stands still in nearly all samples, and then moves by a whole degree."""
    fine = np.linspace(0, 1, 1000)
    coarse = np.radians(np.round(np.degrees(fine)))
    loop = dataclasses.replace(held(5e-3 * fine, coarse, fine), tension=np.empty((1000, 0)))
    assert first_guess(TRUTH, [loop])["wire_offset"] == pytest.approx(5e-3, rel=0.02)


def test_without_load_cells_no_force_is_guessed():
    bend = np.linspace(0, 1, 200)
    blind = dataclasses.replace(held(5e-3 * bend, bend, bend), tension=np.empty((200, 0)))
    guess = first_guess(TRUTH, [blind])
    assert guess.pop("wire_offset") == pytest.approx(5e-3)
    assert guess == {name: value for name, value in FROM_NOTHING.items() if getattr(TRUTH, name) == 0}
