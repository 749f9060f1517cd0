"""The plant is `twin.simulate`, one command after the other."""

import numpy as np
import pytest
from both_twins import same_state
from controlled import PRESET

from twin.control.trial import Plant
from twin.simulation import PHYSICS, simulate

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


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_start_forgets_all_that_was_before(physics):
    pull, sheath = commands(0.1)
    plant = Plant(DRIVEN, 0.1, physics)
    runs = [[plant.start(pull[0]), *map(plant.step, pull[1:], sheath[1:])] for _ in range(2)]
    np.testing.assert_array_equal(*runs)


@pytest.mark.parametrize(
    ("preset", "sample_time", "physics", "message"),
    [
        (PRESET.replace(bending_planes=2), 0.1, "mujoco", "two bending planes: control is of one"),
        (PRESET, 0.015, "mujoco", "must be a whole multiple of the control period"),
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


def test_a_reduced_endoscope_is_not_pushed():
    plant = Plant(PRESET, 0.1, "reduced")
    plant.start(0.0)
    with pytest.raises(ValueError, match=r"force of 0\.1 N at the tip: needs MuJoCo"):
        plant.step(0.0, tip_force=0.1)
