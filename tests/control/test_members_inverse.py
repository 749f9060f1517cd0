"""The inverse of the weighted members: what it asks of them, and who is in charge without them."""

import math

import numpy as np
import pytest
from controlled import LIMITS, PRESET, R, T, assert_within, closed_loop, knowledge

from twin.control.controller import CommandLimits, Sensed
from twin.control.controllers.feedback import PI_SETTINGS
from twin.control.controllers.inverses import MEMBERS_INVERSE, MembersInverse
from twin.control.trial import Plant
from twin.estimation.learned.ram_twins import MemberWeights
from twin.live.monitor import Monitor
from twin.live.reading import Alarm, Source

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
    driven = controller(twins_policy, **{"members-inverse": {"rate_per_s": RATE, "turning_share": 0.0}})
    endoscope, measure = Endoscope(PRESET.replace(sheath_friction_floor=1.6)), noisy()
    driven.start(0.0, WANTED[0])
    pull, off = 0.0, []
    for k in range(150):
        sensed = Sensed(k * T, measure(k, endoscope(pull)), WANTED[k], WANTED[k + 1])
        pull = driven.step(sensed)
        advanced = driven.runtime.advanced
        weights = MemberWeights(advanced.estimator).of(advanced.state)
        members, before = advanced.estimator.members, advanced.state.following
        after = members.step(before, np.array([pull]))
        moved = weights @ (after.of_filters() - before.of_filters())[0]
        error = sensed.reference_deg - driven.estimate_deg
        asked = sensed.next_deg - sensed.reference_deg + (1 - math.exp(-RATE * T)) * error
        off.append(moved - asked)
        assert driven.runtime.reading.source is Source.ADVANCED
        assert not driven.falls_back
    assert np.abs(off).max() < 0.0101  # the tolerance of the inverse


def test_it_turns_round_where_the_reference_is_beyond_what_the_estimate_can_tell_and_nowhere_else(
    twins_policy,
):
    driven = controller(twins_policy, **{"members-inverse": {"turning_share": 1.0}})
    endoscope, measure = Endoscope(), noisy(3)
    driven.start(0.0, WANTED[0])
    pull, direction, turned, held = 0.0, 0.0, 0, 0
    for k in range(300):
        before = pull
        pull = driven.step(Sensed(k * T, measure(k, endoscope(pull)), WANTED[k], WANTED[k + 1]))
        reading = driven.runtime.reading
        apart = abs(WANTED[k + 1] - reading.bend_deg) / ((reading.high_deg - reading.low_deg) / 2)
        held += pull == before
        follows = (WANTED[k + 1] - WANTED[k]) * (pull - before) > 0  # it turns with its reference
        if (pull - before) * direction < 0:
            turned += 1
            assert follows or apart >= 1.0
        if pull == before:
            assert apart < 1.0
            assert (WANTED[k + 1] - WANTED[k]) * direction >= 0
        else:
            direction = pull - before
    assert turned > 5
    assert held > 2


@pytest.mark.parametrize("what", ["silent", "stuck"])
def test_while_the_sensor_says_nothing_the_command_is_held(twins_policy, what):
    """Within two seconds; and it goes on without a jump when the sensor is back."""
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
    assert np.ptp(course.pull_mm[170:301]) == 0
    assert np.ptp(course.pull_mm[140:160]) > 0.1
    error = np.abs(course.bend_deg - WANTED)
    assert error[330:].max() < 2 * error[50:150].max()


def beyond_training():
    """Wanted angles that need commands beyond 4.8 mm, on which the file was not trained."""
    wanted = WANTED.copy()
    wanted[100:160] = 130.0
    return wanted


def test_beyond_the_training_twins_stay_in_charge_that_predict_no_worse(twins_policy, monkeypatch):
    monkeypatch.setattr(Monitor, "predicts_no_worse", True)
    course = closed_loop(controller(twins_policy, BEYOND_TRAINING), Endoscope(), beyond_training(), noisy())
    assert np.abs(course.pull_mm).max() > 4.8
    assert not course.fell_back.any()


def test_beyond_the_training_the_fallback_is_in_charge_without_a_jump_and_trust_comes_back(
    twins_policy, monkeypatch
):
    monkeypatch.setattr(Monitor, "predicts_no_worse", False)
    wanted = beyond_training()
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
    ("tuned", "lead"), [({}, 0), ({"proportional_mm_per_deg": 0.03}, 0), ({"lead_s": 2 * T}, 2)]
)
def test_the_fallback_begins_at_the_command_that_stands_and_goes_on_from_there_by_pi(
    twins_policy, tuned, lead
):
    """A sensor that is off from some sample on parts the trained filter from the fallback.

    Gains and lead are those that were tuned for the active model, which the fallback is.
    """
    measure = noisy(1)
    driven = controller(twins_policy, **{"active-model-pi": tuned})
    alarms = []  # before each sample

    def off(k, bend):
        alarms.append(driven.runtime.reading.alarms if k else Alarm.NONE)
        return measure(k, bend) - 16.0 * (k >= 150)

    course = closed_loop(driven, Endoscope(), WANTED, off, preview=10 if lead else 0)
    assert_within(LIMITS, course.pull_mm)
    ahead = WANTED[lead:]
    first = int(np.flatnonzero(course.fell_back)[0])
    assert 150 < first < 200
    assert alarms[first + 1] & (Alarm.INNOVATION | Alarm.DISAGREEMENT)
    gains = {name: setting.default for name, setting in PI_SETTINGS.items()} | tuned
    line = knowledge().line
    error = ahead[first] - course.believed_deg[first]
    total = course.pull_mm[first] - line.pull_mm(ahead[first]) - gains["proportional_mm_per_deg"] * error
    for k in range(first, first + 15):
        error = ahead[k] - course.believed_deg[k]
        total += gains["integral_mm_per_deg_s"] * T * error
        asked = line.pull_mm(ahead[k + 1]) + gains["proportional_mm_per_deg"] * error + total
        assert course.fell_back[k]
        assert course.pull_mm[k + 1] == pytest.approx(asked, abs=1e-9)


def test_a_trained_file_of_another_agent_is_refused_in_one_line(ram_policy):
    with pytest.raises(ValueError, match="has no twins to invert"):
        controller(ram_policy).start(0.0, 0.0)
