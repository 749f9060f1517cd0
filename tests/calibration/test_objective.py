"""The cost of a preset: nothing for the truth, mean squares in units of the bars for others."""

import numpy as np
import pytest
from calibrating import TRUTH, loops

from twin.calibration.objective import BEND_SCALE, TENSION_SHARE, predict, residuals


def test_truth_costs_nothing_and_residuals_are_in_units_of_the_bars():
    logs = loops(0.5)
    assert (residuals([TRUTH], logs) ** 2).sum() < 1e-12
    off = TRUTH.replace(initial_bend=0.2)
    (episode,), values = predict([off], logs)[0], residuals([off], logs)[0]
    bend = np.mean((episode.bend - logs[0].bend) ** 2) / BEND_SCALE**2
    share = TENSION_SHARE * np.ptp(logs[0].tension)
    tension = np.mean((episode.tension - logs[0].tension) ** 2) / share**2
    assert (values**2).sum() == pytest.approx(bend + tension)
