"""The inverse of the nominal twin, on an endoscope that is the nominal twin."""

import numpy as np
import pytest
from controlled import LIMITS, PRESET, T, assert_within, knowledge

from twin.control.conditions import SIGNALS, reference
from twin.control.controller import CommandLimits, Sensed
from twin.control.controllers.inverses import TWIN_INVERSE
from twin.control.trial import ControlCase, Plant, run_trial
from twin.reduced.twins import TOLERANCE


def tracked(kind, known, preset=PRESET):
    wanted = reference(kind, known.line.reached_deg, 15.0, T, np.random.default_rng(4))
    nothing = np.full(len(wanted), np.nan)
    return run_trial("twin-inverse", known, ControlCase(preset, wanted, nothing, physics="reduced"))


@pytest.mark.parametrize("kind", SIGNALS)
def test_on_the_nominal_twin_the_tolerance_alone_is_left_of_the_error(kind):
    """The endoscope is stepped by control periods, the twin by samples: that differs by less again."""
    known = knowledge()
    trial = tracked(kind, known)
    settled = np.abs(trial.error_deg)
    if kind == "random-steps":  # a step is more than one sample can bring
        settled = settled[np.abs(np.diff(trial.reference_deg, prepend=0))[trial.scored] == 0]
        settled = np.sort(settled)[: len(settled) // 2]
    assert settled.max() < 3 * np.degrees(TOLERANCE)
    assert_within(LIMITS, trial.pull_mm)


@pytest.mark.parametrize("first", [-2.0, 1.5])
def test_it_begins_where_the_endoscope_rests(first):
    """The twin has gone from rest to the first pull, too: its first command brings the bend."""
    known = knowledge()
    endoscope = Plant(PRESET, T, "reduced")
    wanted = endoscope.start(first) + np.copysign(5.0, first)
    controller = TWIN_INVERSE.make(known)
    controller.start(first, wanted)
    pull = controller.step(Sensed(0.0, np.nan, wanted, wanted))
    assert endoscope.step(pull) == pytest.approx(wanted, abs=3 * np.degrees(TOLERANCE))


def test_out_of_reach_it_stands_at_the_end_of_the_stroke():
    known = knowledge(limits=CommandLimits(-2.0, 2.0, 8.0))
    wanted = np.concatenate([np.zeros(35), np.full(30, 80.0), np.full(30, -80.0)])
    nothing = np.full(len(wanted), np.nan)
    trial = run_trial("twin-inverse", known, ControlCase(PRESET, wanted, nothing, physics="reduced"))
    assert trial.pull_mm[64] == 2.0
    assert trial.pull_mm[94] == -2.0
