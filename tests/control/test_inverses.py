"""Inverses of a model and of a twin, on an endoscope that is this model or this twin."""

import dataclasses

import numpy as np
import pytest
from controlled import (
    DEPLOYMENT,
    FALLBACK,
    LIMITS,
    MODEL,
    PRESET,
    T,
    assert_within,
    closed_loop,
    knowledge,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.control.conditions import SIGNALS, reference
from twin.control.controller import CommandLimits
from twin.control.controllers.inverses import CLOSE_MM, MODEL_INVERSE
from twin.control.trial import ControlCase, run_trial
from twin.hysteresis import ColemanHodgdon
from twin.reduced.twins import TOLERANCE

STEEPEST = 1.5 * (MODEL.c_deg_per_mm + 2 * MODEL.a_per_mm * MODEL.b_deg_per_mm * 3.5)


class ModelEndoscope:
    """Eq. 4 of the paper, written out by hand."""

    def __init__(self, model: ColemanHodgdon, pull_mm: float, bend_deg: float) -> None:
        self.model, self.pull_mm, self.bend = model, pull_mm, bend_deg

    def __call__(self, pull_mm: float) -> float:
        a, b, c = self.model.a_per_mm, self.model.b_deg_per_mm, self.model.c_deg_per_mm
        increment = pull_mm - self.pull_mm
        self.bend += a * abs(increment) * (b * pull_mm - self.bend) + c * increment
        self.pull_mm = pull_mm
        return self.bend


@settings(max_examples=20)
@given(st.floats(1.0, 1.6), st.floats(18, 26), st.floats(1, 15), st.floats(0.1, 0.9), st.floats(-20, 20))
def test_on_the_model_itself_nothing_is_left_of_the_error(a, b, c, rate, bend):
    model = ColemanHodgdon(a, b, c)
    deployment = dataclasses.replace(DEPLOYMENT, fallback=dataclasses.replace(FALLBACK, model=model))
    known = knowledge(deployment=deployment, limits=CommandLimits(-8.0, 8.0, 40.0))
    time = np.arange(300) * T
    wanted = bend + 25 * np.sin(rate * time) + 8 * np.sin(2.3 * rate * time)
    endoscope = ModelEndoscope(model, 0.0, bend)
    course = closed_loop(MODEL_INVERSE.make(known), endoscope, wanted, lambda k, bend: np.nan)
    assert np.abs(course.bend_deg - wanted).max() < CLOSE_MM * (c + 2 * a * b * 8)


def test_where_the_limit_of_speed_binds_it_goes_on_behind_it_without_an_error():
    """The model takes note of the command that was given, not of the one that was wanted."""
    known = knowledge(limits=CommandLimits(-3.5, 3.5, 2.0))
    wanted = np.concatenate([np.zeros(10), np.full(60, 45.0), np.full(60, -30.0)])
    endoscope = ModelEndoscope(MODEL, 0.0, 0.0)
    course = closed_loop(MODEL_INVERSE.make(known), endoscope, wanted)
    assert_within(known.limits, course.pull_mm)
    speed = np.abs(np.diff(course.pull_mm)) / T
    assert speed.max() == pytest.approx(2.0)
    off = np.abs(course.bend_deg - wanted)
    assert off.max() > 30
    for end in (69, 129):
        assert off[end] < CLOSE_MM * STEEPEST


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
