"""The oracle: the limit of any controller on an endoscope, whatever its sensor says."""

import numpy as np
import pytest
from controlled import LIMITS, PRESET, T, assert_within, knowledge

from twin.control.conditions import reference
from twin.control.trial import ControlCase, run_trial
from twin.simulation import PHYSICS

OTHER = PRESET.replace(wire_stiffness=6e3, sheath_friction_floor=2.0)


def tracked(controller="oracle", preset=OTHER, noise=np.nan, physics="reduced", **changes):
    wanted = reference("sine", (-30.0, 30.0), 15.0, T, np.random.default_rng(4))
    given = ControlCase(preset, wanted, np.broadcast_to(noise, len(wanted)), physics=physics, **changes)
    return run_trial(controller, knowledge(), given)


@pytest.mark.parametrize("physics", PHYSICS)
def test_it_follows_an_endoscope_that_the_nominal_twin_does_not(physics):
    trial = tracked(physics=physics)
    # A dead band is crossed where the reference turns, as fast as the motor can.
    assert np.median(np.abs(trial.error_deg)) < 0.05
    assert trial.rmse_deg < tracked("twin-inverse", physics=physics).rmse_deg / 5
    assert_within(LIMITS, trial.pull_mm)


@pytest.mark.parametrize(("physics", "what"), [("reduced", "sheath_bend"), ("mujoco", "tip_force")])
def test_it_sees_what_happens_on_the_way(physics, what):
    path = np.linspace(0.0, 1.0, 180)
    course = PRESET.sheath_bend + path if what == "sheath_bend" else 0.05 * path
    trial = tracked(physics=physics, **{what: course})
    assert trial.rmse_deg < tracked(physics=physics).rmse_deg + 0.3
    assert np.abs(trial.truth_deg - tracked(physics=physics).truth_deg).max() > 1e-3
