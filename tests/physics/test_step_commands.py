"""Step commands: they converge with the time step, whatever their size, and both twins agree along them."""

import itertools

import numpy as np
import pytest

from twin.physics.division import LEAST_PART, Division
from twin.preset.file import load_preset
from twin.simulation import simulate

T = 0.02  # between samples [s]
HALF_STROKE = {"ureteroscope": 3e-3, "vio_com": 10e-3}  # [m]
SLOW = 1e-7  # travel of a pulley in a control period that is not divided [m]


def steps(half_stroke: float, rise: int, hold: int = 10) -> np.ndarray:
    """Steps within a stroke [m], each over `rise` samples and held for `hold`."""
    levels = half_stroke * np.array([0.0, 1.0, -1.0, 0.3, -0.5, 0.9])
    paths = [
        np.concatenate([np.linspace(a, b, rise + 1)[1:], np.full(hold, b)])
        for a, b in itertools.pairwise(levels)
    ]
    return np.concatenate([[0.0], *paths])


def share_rms(bend: np.ndarray, reference: np.ndarray) -> float:
    return float(np.sqrt(np.mean((bend - reference) ** 2)) / np.ptp(reference))


@pytest.mark.parametrize("rise", [1, 5])
@pytest.mark.parametrize(("name", "share"), [("ureteroscope", 0.2), ("ureteroscope", 1.0), ("vio_com", 0.6)])
def test_step_commands_converge_with_time_step_and_control_period(name, share, rise):
    preset, pull = load_preset(name), steps(share * HALF_STROKE[name], rise)
    fine = preset.replace(time_step=preset.time_step / 16, control_period=preset.control_period / 16)
    assert share_rms(simulate(preset, pull, T).bend, simulate(fine, pull, T).bend) < 0.01


@pytest.mark.parametrize("name", HALF_STROKE)
def test_twins_agree_on_steps_behind_a_servo(name):
    preset, pull = load_preset(name).replace(servo_speed=0.02), steps(HALF_STROKE[name], 1, hold=60)
    mujoco, reduced = (simulate(preset, pull, T, physics=physics) for physics in ("mujoco", "reduced"))
    assert share_rms(reduced.bend, mujoco.bend) < 0.005


def parts_of(division: Division, *strides: float) -> list[int]:
    """Parts of control periods in which the pulley travels [m]."""
    return division.parts(division.past[2] + np.cumsum(strides)[:, None]).tolist()


def test_parts_grow_at_once_and_become_fewer_by_and_by():
    preset = load_preset("ureteroscope")
    division = Division(preset)
    most = 2 ** int(np.log2(preset.control_period / LEAST_PART))
    # A stop changes the speed as much.
    assert parts_of(division, SLOW, 3e-3, 0.0) == [1, most, most]
    later = parts_of(division, *[0.0] * 20)
    assert sorted(later, reverse=True) == later
    assert set(later) == {2**n for n in range(int(np.log2(most)) + 1)}


def test_parts_of_a_restored_state_go_on_as_those_that_were_saved():
    preset, other = load_preset("ureteroscope"), Division(load_preset("ureteroscope"))
    division = Division(preset)
    assert parts_of(division, 1e-3, 2e-4, 1e-4)[-1] > 1
    other.past[:] = division.past
    following = [0.0, 5e-5, 0.0, 0.0, 0.0]
    assert [parts_of(other, stride)[0] for stride in following] == parts_of(division, *following)


def test_time_step_is_that_of_the_preset_at_most_and_parts_are_whole_steps():
    preset = load_preset("ureteroscope").replace(time_step=2.5e-3)
    division, found = Division(preset), {}
    for stride in (SLOW, *np.geomspace(1e-6, 3e-3, 60)):
        division.reset()
        (parts,) = parts_of(division, stride)
        found[parts] = division.steps(parts)
    assert found[1] == pytest.approx((4, 2.5e-3))
    assert found[2] == pytest.approx((2, 2.5e-3))
    for parts, (count, step) in found.items():
        assert parts * count * step == pytest.approx(preset.control_period)
        assert step <= preset.time_step
