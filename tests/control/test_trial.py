"""Plants and trials: who is given what at which sample, and what is scored of it."""

import dataclasses
import math

import numpy as np
import pytest
from both_twins import same_state
from controlled import LIMITS, PRESET, T, assert_within, knowledge

from twin.control import controller as registry
from twin.control.conditions import reference
from twin.control.controller import Controller, ControllerSpec, controller_specs, find_controllers
from twin.control.trial import HOLD_S, ControlCase, ControlTrial, Plant, run_trial
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


def test_a_reference_that_is_known_ahead_is_given_so_far_and_no_further(witnesses):
    given = drive()
    run_trial("witness", knowledge(preview_s=0.5), given)
    for k, sensed in enumerate(witnesses[0].seen):
        np.testing.assert_array_equal(sensed.reference_preview_deg, given.reference_deg[k + 1 : k + 6])


def following(name, lead_s, preview_s=1.0) -> ControlTrial:
    """A controller along a sine that it follows some time ahead."""
    settings = {name: {"lead_s": lead_s} if lead_s else {}}
    known = knowledge(preview_s=preview_s, sample_time=0.02, settings=settings)
    wanted = reference("fast-sine", (-40.0, 40.0), 8.0, 0.02, np.random.default_rng(1))
    plant = PRESET.replace(sheath_friction_floor=2.1, sheath_friction_growth=2.7)  # the nominal one lags less
    return run_trial(name, known, ControlCase(plant, wanted, np.zeros(len(wanted)), physics="reduced"))


def test_a_lead_is_that_many_samples_of_the_reference_and_ends_with_it(witnesses):
    given = drive()
    run_trial("witness", knowledge(preview_s=0.5, settings={"witness": {"lead_s": 0.3}}), given)
    seen = witnesses[0].seen
    last = len(seen) - 1
    for k, sensed in enumerate(seen[:-1]):
        assert sensed.reference_deg == given.reference_deg[min(k + 3, last)]
        assert sensed.next_deg == given.reference_deg[min(k + 4, last)]


@pytest.mark.parametrize("name", ["linear", "model-inverse", "twin-inverse", "active-model-pi", "pid"])
def test_a_lead_helps_every_lagging_loop_on_a_sine(name):
    assert following(name, 0.2).rmse_deg < 0.95 * following(name, 0.0).rmse_deg


@pytest.mark.parametrize("name", ["linear", "pid"])
def test_without_preview_a_lead_changes_nothing(name):
    first, again = following(name, 0.4, preview_s=0.0), following(name, 0.0, preview_s=0.0)
    np.testing.assert_array_equal(first.pull_mm, again.pull_mm)
    (spec,) = find_controllers([name])
    assert spec.searched(0.0) == spec.settings
    assert spec.searched(0.7)["lead_s"] == (0.0, 0.0, 0.7)


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
    assert trial.travel_mm == pytest.approx(3.5)


def test_reversals_are_counted_while_the_reference_is_held_and_above_a_resolution():
    sample_time, held = 0.1, 40
    wanted = np.concatenate([np.zeros(30), np.arange(20.0), np.full(held, 20.0)])
    zigzag = np.where(np.arange(len(wanted)) // 2 % 2, 1.0, 0.0)  # turns at every second sample
    counted = held - 1 - 4  # samples of the hold from its first half second on

    def per_second(pull):
        return trial_of(wanted, wanted, pull, sample_time).holding_reversals_per_s

    assert per_second(0.02 * zigzag) == pytest.approx(5.0, abs=1 / (counted * sample_time))
    assert per_second(0.009 * zigzag) == 0.0
    assert per_second(np.where(np.arange(len(wanted)) < 50, zigzag, 1.0)) == 0.0
    assert math.isnan(trial_of(range(90), range(90), zigzag, sample_time).holding_reversals_per_s)


N = 25
DRIVEN = PRESET.replace(
    command_zero=2e-4, servo_gain=12.0, servo_speed=6e-3, backlash=5e-5, command_delay=0.03, friction_wear=0.1
)
CASES = [(PRESET, 0.01), (PRESET, 0.05), (DRIVEN, 0.1)]


def commands(sample_time, first=0.8) -> tuple[np.ndarray, np.ndarray]:
    """Pull [mm] that turns round twice, and a sheath that bends meanwhile [rad]."""
    time = np.arange(N) * sample_time
    pull = first + 1.2 * np.sin(2 * np.pi * np.arange(N) / 18)
    return pull, PRESET.sheath_bend + 0.4 * np.sin(time) ** 2


@pytest.mark.parametrize("physics", PHYSICS)
@pytest.mark.parametrize(("preset", "sample_time"), CASES)
@pytest.mark.parametrize("bends", [False, True])
def test_commands_one_by_one_are_a_simulation_bit_for_bit(physics, preset, sample_time, bends):
    pull, sheath = commands(sample_time)
    whole = simulate(preset, pull * 1e-3, sample_time, physics=physics, sheath_bend=sheath if bends else None)
    plant = Plant(preset, sample_time, physics)
    bend = [plant.start(pull[0])]
    for k in range(1, N):
        bend.append(plant.step(pull[k], sheath[k] if bends else None))
    np.testing.assert_array_equal(bend, whole.truth_deg)
    assert np.ptp(bend) > 10


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_state_that_is_restored_goes_on_bit_for_bit_in_the_same_plant_and_in_another(physics):
    pull, sheath = commands(0.1)
    plant, other = (Plant(DRIVEN, 0.1, physics) for _ in range(2))
    plant.start(pull[0])
    for k in range(1, 12):
        plant.step(pull[k], sheath[k])
    saved = plant.save_state()
    courses = []
    for of in (plant, plant, other):
        of.restore_state(saved)
        courses.append([of.bend_deg(), *(of.step(pull[k], sheath[k]) for k in range(12, N))])
    for course in courses[1:]:
        np.testing.assert_array_equal(course, courses[0])
    assert same_state(plant.endoscope.save_state(), other.endoscope.save_state())
    assert (other.pull_mm, other.sheath_bend) == (pull[-1], sheath[-1])


@pytest.mark.parametrize(
    ("preset", "sample_time", "physics", "message"),
    [
        (PRESET.replace(bending_planes=2), 0.1, "mujoco", "two bending planes: control is of one"),
        (PRESET, 0.0, "mujoco", "sample time 0 s: must be positive"),
        (PRESET, 0.1, "magic", "unknown physics 'magic'; valid: mujoco, reduced"),
    ],
)
def test_what_cannot_be_driven_is_refused_in_one_line(preset, sample_time, physics, message):
    with pytest.raises(ValueError, match=message) as refused:
        Plant(preset, sample_time, physics)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_command_that_is_no_number_and_a_sheath_bent_backwards_are_refused(physics):
    plant = Plant(PRESET, 0.1, physics)
    plant.start(0.0)
    with pytest.raises(ValueError, match="must be a finite number"):
        plant.step(np.nan)
    with pytest.raises(ValueError, match="not negative"):
        plant.step(0.1, -9.0)
    if physics == "reduced":
        with pytest.raises(ValueError, match=r"force of 0\.1 N at the tip: needs MuJoCo"):
            plant.step(0.0, tip_force=0.1)


def test_a_force_pushes_the_tip_and_what_is_let_go_is_held_by_friction():
    bends = []
    for force in (0.0, 0.05, 0.1, -0.1):
        plant = Plant(PRESET, 0.1)
        plant.start(1.0)
        bends.append([plant.step(1.0, tip_force=force) for _ in range(8)][-1])
        if force == 0.1:
            let_go = [plant.step(1.0) for _ in range(8)][-1]
    free, light, pushed, back = bends
    assert back < free < light < let_go < pushed
