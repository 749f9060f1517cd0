"""Trials: who is given what at which sample, and what is scored of it."""

import dataclasses
import math

import numpy as np
import pytest
from controlled import LIMITS, PRESET, T, assert_within, knowledge
from hypothesis import given
from hypothesis import strategies as st

from twin.control import controller as registry
from twin.control.conditions import reference
from twin.control.controller import CommandLimits, Controller, ControllerSpec, controller_specs
from twin.control.trial import HOLD_S, ControlCase, ControlTrial, run_trial
from twin.signals.sensor import measure
from twin.simulation import PHYSICS, simulate

HELD = round(HOLD_S / T)


class Witness(Controller):
    """Keeps what it is given, and wants a pull that says at which sample it was wanted."""

    def __init__(self, known) -> None:
        super().__init__(known.limits, known.sample_time)
        self.started, self.seen = [], []

    def _start(self, reference_deg: float) -> None:
        self.started.append((self.pull_mm, reference_deg))

    def _wanted_mm(self, sensed) -> float:
        self.seen.append(sensed)
        self.estimate_deg, self.falls_back = float(len(self.seen)), len(self.seen) % 3 == 0
        return 1.0 + 0.5 * math.sin(0.3 * len(self.seen))


@pytest.fixture
def witnesses(monkeypatch) -> list[Witness]:
    """Every `witness` that a trial has made."""
    controller_specs()
    monkeypatch.setattr(registry, "_SPECS", dict(registry._SPECS))
    made = []

    def build(known, settings):
        made.append(Witness(known))
        return made[-1]

    registry.register_controller(ControllerSpec("witness", 99, "all", build))
    return made


def drive(preset=PRESET, physics="reduced", sample_time=T, **changes) -> ControlCase:
    wanted = reference("sine", (-40.0, 40.0), 2.0, sample_time, np.random.default_rng(1))
    noise = np.random.default_rng(2).normal(0, 0.3, len(wanted))
    return ControlCase(preset, wanted, **{"noise_deg": noise, "physics": physics} | changes)


def test_a_controller_is_given_the_reference_of_now_and_next_and_the_noisy_angle_of_now(witnesses):
    given = drive()
    given.noise_deg[5:9] = np.nan
    trial = run_trial("witness", knowledge(), given)
    (witness,) = witnesses
    time, measured, now, following = np.array([sensed[:4] for sensed in witness.seen]).T
    np.testing.assert_allclose(time, np.arange(len(time)) * T, atol=1e-12)
    np.testing.assert_array_equal(now, given.reference_deg)
    np.testing.assert_array_equal(following[:-1], given.reference_deg[1:])
    assert following[-1] == given.reference_deg[-1]
    assert not any(len(sensed.reference_preview_deg) for sensed in witness.seen)
    np.testing.assert_array_equal(measured, trial.truth_deg + given.noise_deg)
    assert np.isnan(measured[5:9]).all()
    np.testing.assert_array_equal(trial.measured_deg, measured)
    assert witness.started == [(trial.pull_mm[0], given.reference_deg[0])]


def test_a_reference_that_is_known_ahead_is_told_so_far_and_no_further(witnesses):
    given = drive()
    run_trial("witness", knowledge(preview_s=0.5), given)
    for k, sensed in enumerate(witnesses[0].seen):
        np.testing.assert_array_equal(sensed.reference_preview_deg, given.reference_deg[k + 1 : k + 6])


@pytest.mark.parametrize("physics", PHYSICS)
def test_its_angle_is_that_of_a_simulation_along_its_commands(witnesses, physics):
    sheath = PRESET.sheath_bend + 0.5 * np.linspace(0, 1, HELD + 20)
    trial = run_trial("witness", knowledge(), drive(physics=physics, sheath_bend=sheath))
    expected = simulate(PRESET, trial.pull_mm * 1e-3, T, physics=physics, sheath_bend=sheath)
    np.testing.assert_array_equal(trial.truth_deg, expected.truth_deg)
    # The command of a sample acts at the end of it.
    samples = np.arange(1, len(trial.pull_mm))
    np.testing.assert_allclose(trial.pull_mm[2:], 1 + 0.5 * np.sin(0.3 * samples[1:]), atol=1e-12)


@pytest.mark.parametrize(
    ("latency", "sample_time"),
    [(0.0, T), (0.04, T), (0.1, T), (0.25, T), (0.3, T), (0.7, T), (0.05, 0.02), (0.14, 0.02)],
)
def test_a_late_sensor_says_what_the_sensor_of_a_record_would_say(witnesses, latency, sample_time):
    """One that is on its way at a sample has not arrived: it is of the next one. 0.14 / 0.02 is above 7."""
    preset = PRESET.replace(sensor_latency=latency)
    given = drive(preset, sample_time=sample_time)
    known = knowledge(sample_time=sample_time)
    trial = run_trial("witness", known, dataclasses.replace(given, noise_deg=0 * given.noise_deg))
    time = np.arange(len(trial.truth_deg)) * sample_time
    reported = measure(preset, time, np.radians(trial.truth_deg), np.random.default_rng(0))
    np.testing.assert_allclose(trial.measured_deg, np.degrees(reported), atol=1e-12)
    late = math.ceil(round(latency / sample_time, 6))
    np.testing.assert_array_equal(trial.measured_deg[late:], trial.truth_deg[: len(time) - late])


def test_it_begins_at_the_pull_of_the_line_cut_by_the_limits(witnesses):
    known = knowledge()
    trial = run_trial("witness", known, drive())
    assert trial.pull_mm[0] == known.line.pull_mm(trial.reference_deg[0])
    narrow = knowledge(limits=CommandLimits(0.5, 3.0, 8.0))
    low = drive()
    low.reference_deg[:] = -70.0
    assert run_trial("witness", narrow, low).pull_mm[0] == 0.5


@pytest.mark.parametrize("name", ["linear", "active-model-pi"])
def test_one_trial_is_the_same_bits_every_time_and_within_the_limits(name):
    first, again = (run_trial(name, knowledge(), drive()) for _ in range(2))
    for field in dataclasses.fields(ControlTrial):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(again, field.name))
    assert_within(LIMITS, first.pull_mm)


def trial_of(bend, wanted, pull, sample_time=0.5) -> ControlTrial:
    nothing = np.full(len(bend), np.nan)
    return ControlTrial(*map(np.array, (wanted, pull, bend)), nothing, nothing, nothing > 0, sample_time)


def test_scores_are_of_what_comes_behind_the_hold():
    """HOLD_S are six samples of half a second; behind it, errors of 3, -4, 0 and 0 and 1 + 2 + 0.5 mm."""
    bend = [90.0] * 6 + [13.0, 6.0, 10.0, 10.0]
    trial = trial_of(bend, [10.0] * 10, [50.0, 0, 9, 0, 9, 0, 1.0, 2.0, 0.0, 0.5])
    np.testing.assert_array_equal(trial.error_deg, [3.0, -4.0, 0.0, 0.0])
    assert trial.rmse_deg == pytest.approx(2.5)
    assert trial.worst_deg == 4.0
    assert trial.travel_mm == pytest.approx(3.5)


@given(st.lists(st.tuples(*[st.floats(-90, 90)] * 3), min_size=8, max_size=40), st.floats(-20, 20))
def test_scores_depend_on_errors_and_steps_alone(rows, shift):
    bend, wanted, pull = np.array(rows).T
    trial = trial_of(bend, wanted, pull)
    moved = trial_of(bend + shift, wanted + shift, pull - shift)
    mirrored = trial_of(-bend, -wanted, -pull)
    for of in ("rmse_deg", "worst_deg", "travel_mm"):
        assert getattr(moved, of) == pytest.approx(getattr(trial, of), abs=1e-9)
        assert getattr(mirrored, of) == getattr(trial, of)
    assert trial.rmse_deg <= trial.worst_deg + 1e-12
    assert trial.travel_mm >= abs(pull[-1] - pull[6]) - 1e-9
