"""The reduced twin against that in MuJoCo: bend, tension, friction and slack along all kinds of commands."""

import numpy as np
import pytest

from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges
from twin.signals.excitation import SIGNALS, command
from twin.simulation import simulate_batch

T = 0.1
LEAST_RANGE = np.radians(45)
"""Range of the endoscopes over their stroke; some records hardly move, where a share says little."""
STROKES = {"ureteroscope": (-3e-3, 3e-3), "vio_com": (-10e-3, 10e-3)}


def both(presets, pulls, **inputs):
    found = [
        simulate_batch(presets, pulls, T, physics=physics, threads=1, **inputs)
        for physics in ("mujoco", "reduced")
    ]
    return list(zip(*found, strict=True))


def differences(mujoco, reduced) -> tuple[float, float, float]:
    """RMS and largest difference of the bend, and the largest of the tensions, as shares of their ranges."""
    away = (reduced.bend - mujoco.bend) / max(np.ptp(mujoco.bend), LEAST_RANGE)
    tension = np.abs(reduced.wire_tension - mujoco.wire_tension).max() / np.ptp(mujoco.wire_tension)
    return float(np.sqrt(np.mean(away**2))), float(np.abs(away).max()), float(tension)


def assert_close(mujoco, reduced, rms: float = 0.002, largest: float = 0.01) -> None:
    found = differences(mujoco, reduced)
    assert found[0] <= rms, found
    assert found[1] <= largest, found
    assert found[2] <= 0.015, found


@pytest.mark.parametrize("name", STROKES)
def test_all_kinds_of_signals_agree(name):
    rng = np.random.default_rng(1)
    pulls = [command(kind, STROKES[name], 20.0, T, rng) for kind in SIGNALS]
    for mujoco, reduced in both([load_preset(name)] * len(pulls), pulls):
        assert_close(mujoco, reduced)
        assert np.abs(reduced.pulley - mujoco.pulley).max() < 1e-6
        # Friction is that of the state here, there that of the control period before.
        np.testing.assert_allclose(reduced.sheath_friction, mujoco.sheath_friction, rtol=0.1, atol=5e-3)
        np.testing.assert_allclose(reduced.wire_slack, mujoco.wire_slack, atol=2e-5)


@pytest.mark.parametrize("name", STROKES)
def test_drawn_endoscopes_and_a_moving_sheath_agree(name):
    rng, preset, ranges = np.random.default_rng(3), load_preset(name), load_ranges(name)
    drawn = [ranges.draw(preset, rng) for _ in range(6)]
    pulls = [command(kind, STROKES[name], 20.0, T, rng) for kind in (*SIGNALS, "sine")]
    for mujoco, reduced in both(drawn, pulls[: len(drawn)]):
        assert_close(mujoco, reduced)
    moving = preset.sheath_bend * (1 + 0.8 * np.sin(np.arange(len(pulls[0])) * T / 3))
    ((mujoco, reduced),) = both([preset], pulls[:1], sheath_bends=[moving])
    assert_close(mujoco, reduced)


@pytest.mark.slow
def test_at_small_steps_and_slow_commands_hardly_anything_is_left():
    for name, stroke in STROKES.items():
        preset = load_preset(name)
        fine = preset.replace(time_step=preset.time_step / 8, control_period=preset.control_period / 8)
        pull = command("sine", stroke, 15.0, T, np.random.default_rng(2))
        ((mujoco, reduced),) = both([fine], [pull])
        assert_close(mujoco, reduced, rms=0.0001, largest=0.0005)


def test_two_planes_agree():
    preset = load_preset("vio_com").replace(bending_planes=2)
    rng = np.random.default_rng(5)
    pull, lateral = (command(kind, (-8e-3, 8e-3), 20.0, T, rng) for kind in ("sine", "triangle"))
    ((mujoco, reduced),) = both([preset], [pull], lateral_pulls=[lateral])
    assert_close(mujoco, reduced)
    away = (reduced.lateral_bend - mujoco.lateral_bend) / np.ptp(mujoco.lateral_bend)
    assert np.abs(away).max() < 0.01


@pytest.mark.parametrize(
    "drive",
    [
        {"backlash": 1e-4},
        {"servo_gain": 8.0, "servo_speed": 4e-3},
        {"wire_toe": 3.0},
        {"encoder_counts": 4000, "backlash": 5e-5, "servo_acceleration": 0.05},
    ],
)
def test_the_same_drive_is_before_it(drive):
    preset = load_preset("ureteroscope").replace(**drive)
    pull = command("triangle", (-2e-3, 2e-3), 15.0, T, np.random.default_rng(6))
    ((mujoco, reduced),) = both([preset], [pull])
    assert_close(mujoco, reduced)
