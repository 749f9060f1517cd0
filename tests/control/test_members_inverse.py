"""The inverse of the weighted members: what it asks of them, and who is in charge without them."""

import math

import numpy as np
import pytest
from controlled import LIMITS, PRESET, R, T, assert_within, closed_loop, knowledge

from twin.control.controller import Sensed
from twin.control.controllers.linear import LINEAR
from twin.control.controllers.members_inverse import MEMBERS_INVERSE, MembersInverse
from twin.control.feedback import PI_SETTINGS
from twin.control.limits import CommandLimits
from twin.control.plant import Plant
from twin.estimation.learned.member_weights import MemberWeights
from twin.runtime.reading import Alarm, Source

RATE = 2.0
BEYOND_TRAINING = CommandLimits(-6.0, 6.0, 8.0)
N = 400
WANTED = 35 * np.sin(np.arange(N) * 2 * np.pi * T / 8)


class Endoscope:
    """A reduced plant that rests at its first pull when it is asked first."""

    def __init__(self, preset=PRESET) -> None:
        self.plant, self._begun = Plant(preset, T, "reduced"), False

    def __call__(self, pull_mm: float) -> float:
        begun, self._begun = self._begun, True
        return self.plant.step(pull_mm) if begun else self.plant.start(pull_mm)


def controller(policy, limits=LIMITS, **settings) -> MembersInverse:
    known = knowledge(policy=policy, limits=limits, settings=settings)
    return MEMBERS_INVERSE.make(known)


def noisy(seed=0):
    rng = np.random.default_rng(seed)
    return lambda k, bend: bend + rng.normal(0, R**0.5)


def test_its_command_moves_the_weighted_members_by_what_is_asked_of_them(twins_policy):
    """sum_m w_m [theta_m(u) - theta_m] = r_next - r + (1 - exp(-rate T)) (r - estimate)."""
    driven = controller(twins_policy, **{"members-inverse": {"rate_per_s": RATE}})
    endoscope, measure = Endoscope(PRESET.replace(sheath_friction_floor=1.6)), noisy()
    driven.start(0.0, WANTED[0])
    pull, off = 0.0, []
    for k in range(150):
        sensed = Sensed(k * T, measure(k, endoscope(pull)), WANTED[k], WANTED[k + 1])
        pull = driven.step(sensed)
        advanced = driven.runtime.advanced
        weights = MemberWeights(advanced.estimator.network).of(advanced.state)
        members, before = advanced.estimator.members, advanced.state.following
        after = members.step(before, np.array([pull]))
        moved = weights @ (after.of_filters() - before.of_filters())[0]
        error = sensed.reference_deg - driven.bend_deg
        asked = sensed.next_deg - sensed.reference_deg + (1 - math.exp(-RATE * T)) * error
        off.append(moved - asked)
        assert driven.runtime.reading.source is Source.ADVANCED
        assert not driven.falls_back
    assert np.abs(off).max() < 0.0101  # the tolerance of the inverse


def test_the_nominal_endoscope_is_followed_far_better_than_by_the_line(twins_policy):
    ours, line = (
        closed_loop(driven, Endoscope(), WANTED, noisy())
        for driven in (controller(twins_policy), LINEAR.make(knowledge()))
    )
    errors = [np.sqrt(np.mean((of.bend_deg - WANTED)[30:] ** 2)) for of in (ours, line)]
    assert errors[0] < 0.4 * errors[1]
    assert not ours.fell_back.any()
    assert_within(LIMITS, ours.pull_mm)


@pytest.mark.parametrize("what", ["silent", "stuck"])
def test_while_the_sensor_says_nothing_the_members_go_on_alone(twins_policy, what):
    """They are twins, and foretell better than the fallback; a sensor that is stuck counts as silent."""
    measure, last = noisy(), [0.0]

    def seen(k: int, bend: float) -> float:
        if not 150 <= k < 300:
            last[0] = measure(k, bend)
            return last[0]
        return math.nan if what == "silent" else last[0]

    driven = controller(twins_policy)
    course = closed_loop(driven, Endoscope(), WANTED, seen)
    assert_within(LIMITS, course.pull_mm)
    assert not course.fell_back.any()
    assert np.abs(course.bend_deg - WANTED)[160:].max() < 10
    steps = np.abs(np.diff(course.pull_mm))
    assert steps[150:].max() < 1.5 * steps[50:150].max()


def test_beyond_the_training_the_fallback_is_in_charge_without_a_jump_and_trust_comes_back(twins_policy):
    """A command beyond 4.8 mm is none that the file was trained on."""
    wanted = WANTED.copy()
    wanted[100:160] = 130.0
    driven = controller(twins_policy, BEYOND_TRAINING)
    course = closed_loop(driven, Endoscope(), wanted, noisy())
    assert_within(BEYOND_TRAINING, course.pull_mm)
    fell_back = course.fell_back.astype(bool)
    (first,) = np.flatnonzero(np.diff(fell_back.astype(int)) == 1) + 1
    (back,) = np.flatnonzero(np.diff(fell_back.astype(int)) == -1) + 1
    beyond = np.flatnonzero(np.abs(course.pull_mm) > 4.8)
    assert beyond[0] <= first <= beyond[0] + 5
    assert 5.0 <= (back - beyond[-1]) * T <= 8.0
    assert back < N - 50
    assert not fell_back[back:].any()
    # Back with the members, it follows as before.
    error = np.abs(course.bend_deg - wanted)
    assert error[back + 30 :].max() < 2 * error[50:95].max()


@pytest.mark.parametrize(
    ("offset", "tuned"), [(-12.0, {}), (12.0, {}), (12.0, {"proportional_mm_per_deg": 0.03})]
)
def test_the_fallback_begins_at_the_command_that_stands_and_goes_on_from_there_by_pi(
    twins_policy, offset, tuned
):
    """A sensor that is off from some sample on parts the trained filter from the fallback.

    Gains are those that were tuned for the active model, which the fallback is.
    """
    measure = noisy(1)
    driven = controller(twins_policy, **{"active-model-pi": tuned})
    course = closed_loop(driven, Endoscope(), WANTED, lambda k, bend: measure(k, bend) + offset * (k >= 150))
    assert_within(LIMITS, course.pull_mm)
    first = int(np.flatnonzero(course.fell_back)[0])
    assert 150 < first < 200
    assert driven.runtime.reading.alarms & (Alarm.INNOVATION | Alarm.DISAGREEMENT)
    gains = {name: setting.default for name, setting in PI_SETTINGS.items()} | tuned
    line = knowledge().line
    total = course.pull_mm[first] - line.pull_mm(WANTED[first])
    for k in range(first, first + 15):
        error = WANTED[k] - course.believed_deg[k]
        total += gains["integral_mm_per_deg_s"] * T * error
        asked = line.pull_mm(WANTED[k + 1]) + gains["proportional_mm_per_deg"] * error + total
        assert course.fell_back[k]
        assert course.pull_mm[k + 1] == pytest.approx(asked, abs=1e-9)


def test_a_trained_file_of_another_agent_is_refused_in_one_line(ram_policy):
    with pytest.raises(ValueError, match="has no twins to invert"):
        controller(ram_policy).start(0.0, 0.0)
