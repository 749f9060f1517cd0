"""The loop of dry friction: of no rate, memory without drift, and none of step or number of vertebrae."""

import numpy as np
import pytest
from both_twins import MUJOCO
from driven_endoscope import AMPLITUDE, PRESET, SAMPLE_TIME, loop_of, sine


def width_of(pull: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Falling minus rising branch on a common grid of pulls [deg]."""
    top, bottom = pull.argmax(), pull.argmin()
    grid = np.linspace(pull.min(), pull.max(), 801)
    falling = np.interp(grid, pull[top : bottom + 1][::-1], bend[top : bottom + 1][::-1])
    rising_pull = np.concatenate([pull[bottom:], pull[1 : top + 1]])  # the cycle closes
    rising = np.interp(grid, rising_pull, np.concatenate([bend[bottom:], bend[1 : top + 1]]))
    return falling - rising


@pytest.fixture(scope="module")
def loop(twin) -> tuple[np.ndarray, np.ndarray]:
    return loop_of(twin, PRESET, 8.0)


def test_time_step_is_short_enough():
    coarse = loop_of(MUJOCO, PRESET, 8.0)[1]
    _, fine = loop_of(MUJOCO, PRESET.replace(time_step=PRESET.time_step / 8), 8.0)
    assert np.abs(coarse - fine).max() < 0.01 * np.ptp(fine)


def test_loop_depends_neither_on_speed_nor_on_the_number_of_vertebrae():
    areas = [abs(np.trapezoid(*loop_of(MUJOCO, PRESET, period)[::-1])) for period in (2.0, 8.0, 32.0)]
    assert np.ptp(areas) < 0.02 * np.mean(areas)
    bends = [loop_of(MUJOCO, PRESET.replace(vertebrae=n), 8.0)[1] for n in (8, 16, 64)]
    assert np.ptp(bends, axis=0).max() < 0.02 * np.ptp(bends)


@pytest.mark.parametrize("viscous", [True, False])
def test_without_friction_there_is_no_loop(twin, viscous):
    preset = PRESET.without_friction() if viscous else PRESET.without_friction().without_viscosity()
    pull, bend = loop_of(twin, preset, 8.0)
    assert np.abs(width_of(pull, bend)).max() < 0.005 * np.ptp(bend)


@pytest.mark.parametrize(
    "cycles",
    [1.25, 1.0, 1.5, 1.12, 1.35, 1.75],
    ids=["top", "mid rising", "mid falling", "high rising", "high falling", "bottom"],
)
def test_held_command_does_not_drift(twin, loop, cycles):
    moving = sine(8.0, cycles)
    held = np.full(round(30 / SAMPLE_TIME), moving[-1])
    episode = twin.simulate(PRESET, np.concatenate([moving, held]), SAMPLE_TIME)
    after = episode.truth_deg[len(moving) - 1 :]  # settling after the sudden stop included
    assert np.abs(after - after[0]).max() < 0.005 * np.ptp(loop[1])
    assert np.abs(after[50:] - after[50]).max() < 2e-5 * np.ptp(loop[1])  # static friction does not creep


@pytest.mark.parametrize(("low", "high"), [(-1e-3, 2e-3), (0.5e-3, 3.5e-3), (-3e-3, -2e-3)])
def test_minor_loop_closes_and_is_wiped_out(twin, loop, low, high):
    """Madelung's rules: back where it began, a minor loop leaves no trace in what follows."""
    before = np.concatenate([sine(8.0, 1.25), np.linspace(AMPLITUDE, low, 300)[1:]])
    minor = np.concatenate([np.linspace(low, high, 200)[1:], np.linspace(high, low, 200)[1:]])
    after = np.linspace(low, -AMPLITUDE, 200)[1:]
    with_loop, without = twin.simulate_batch(
        [PRESET] * 2,
        [np.concatenate([before, minor, after]), np.concatenate([before, after])],
        SAMPLE_TIME,
    )
    begun, closed = len(before) - 1, len(before) + len(minor) - 1
    bends = with_loop.truth_deg
    assert np.abs(bends[begun : closed + 1] - bends[begun]).max() > 0.01 * np.ptp(loop[1])  # it is a loop
    off = bends[closed:] - without.truth_deg[begun:]
    assert np.abs(off).max() < 0.005 * np.ptp(loop[1])
