"""Tracking as an environment: what is observed, commanded and rewarded, and that an episode is repeatable."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_gymnasium
from stable_baselines3.common.env_checker import check_env as check_stable_baselines

from rl.registration import ENVIRONMENT_ID, TRACKING_ID
from rl.tracking import TRAVEL_COST_PER_MM, TrackingEnvironment
from twin.control.controllers.ppo import ERROR_DEG, SMOOTHING_S
from twin.errors import InputError
from twin.physics import choose_backend
from twin.preset.file import load_preset

needs_gl = pytest.mark.skipif(choose_backend() == "disable", reason="nothing here draws without a screen")
T = 0.02
STILL = np.zeros(1, np.float32)


def short(**settings) -> TrackingEnvironment:
    return TrackingEnvironment(**{"physics": "reduced", "seconds": 2.0} | settings)


def course(environment, actions) -> list[tuple]:
    """All that an environment says to actions, of the next episode too where one ends."""
    said = []
    for action in actions:
        observation, reward, _, truncated, info = environment.step(np.array([action], np.float32))
        said.append((observation.tobytes(), reward, truncated, *info.values()))
        if truncated:
            observation, info = environment.reset()
            said.append((observation.tobytes(), *info.values()))
    return said


def random_actions(count, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, count)


@pytest.mark.parametrize("physics", ["mujoco", "reduced"])
def test_the_environment_passes_both_checkers(physics):
    environment = gymnasium.make(TRACKING_ID, physics=physics).unwrapped
    check_gymnasium(environment, skip_render_check=True)
    check_stable_baselines(environment)


@pytest.mark.slow
def test_gymnasium_makes_both_by_their_ids_alone():
    made = f"gymnasium.make('rl:{TRACKING_ID}').reset(); gymnasium.make('{ENVIRONMENT_ID}').reset()"
    subprocess.run([sys.executable, "-c", f"import gymnasium; {made}"], check=True)


@pytest.mark.parametrize("physics", ["mujoco", "reduced"])
def test_a_restored_run_goes_on_bit_for_bit_through_the_next_episode(physics):
    preset = load_preset("ureteroscope").replace(sensor_latency=0.06)
    environment = short(preset=preset, physics=physics, randomized=True)
    environment.reset(seed=3)
    course(environment, random_actions(100))
    state, others = environment.save_state(), random_actions(400, seed=1)
    first = course(environment, others)
    assert sum(len(one) == 4 for one in first) >= 1  # another endoscope has been drawn meanwhile
    environment.restore_state(state)
    assert course(environment, others) == first
    elsewhere = short(preset=preset, physics=physics, randomized=True)
    elsewhere.reset(seed=4)
    elsewhere.restore_state(state)
    assert course(elsewhere, others) == first


def test_no_action_makes_the_command_leave_its_limits():
    environment = short(stroke_mm=(-0.6, 1.0), speed_mm_s=4.0, seconds=8.0)
    limits = environment.limits
    assert (limits.low_mm, limits.high_mm) == pytest.approx((-3.0, 3.4))
    rng, pulls = np.random.default_rng(0), []
    for seed in range(4):
        _, info = environment.reset(seed=seed)
        pulls.append([info["pull_mm"]])
        truncated = False
        while not truncated:
            if len(pulls[-1]) % 100 == 1:  # long pushes either way, far outside [-1, 1] too
                push = rng.choice([-1, 1]) * rng.uniform(0.5, 3)
            action = np.array([push + rng.uniform(-0.3, 0.3)], np.float32)
            _, _, _, truncated, info = environment.step(action)
            pulls[-1].append(info["pull_mm"])
    flat, steps = np.concatenate(pulls), np.concatenate([np.diff(run) for run in pulls])
    assert flat.min() == limits.low_mm
    assert flat.max() == limits.high_mm
    assert np.abs(steps).max() == pytest.approx(4.0 * T, rel=1e-12)


def test_no_action_is_control_by_the_line():
    environment = short(seconds=8.0)
    _, info = environment.reset(seed=1)
    truncated = False
    while not truncated:
        line = environment.line.pull_mm(info["reference_deg"])
        assert info["pull_mm"] == pytest.approx(line, abs=1e-12)
        *_, truncated, info = environment.step(STILL)


def test_an_action_moves_the_offset_by_its_share_of_the_fastest_change():
    environment = short(signals=("sine",))
    observation, before = environment.reset(seed=0)
    observation, _, _, _, after = environment.step(np.array([0.3], np.float32))  # the reference stands still
    assert after["pull_mm"] - before["pull_mm"] == pytest.approx(0.3 * 5.0 * T)
    np.testing.assert_allclose(observation[4:], [0.3 * 5.0 * T / 0.5, 0.3], rtol=1e-5)


def test_the_reward_counts_the_true_error_and_the_travel():
    environment = short(noise_variance=9.0)
    _, before = environment.reset(seed=2)
    for action in random_actions(200):
        _, reward, _, _, info = environment.step(np.array([action], np.float32))
        error = info["bend_deg"] - info["reference_deg"]
        travel = abs(info["pull_mm"] - before["pull_mm"])
        assert reward == pytest.approx(-((error / ERROR_DEG) ** 2) - TRAVEL_COST_PER_MM * travel)
        assert info["bend_deg"] == environment.plant.bend_deg()
        before = info


def test_the_sensor_is_late_and_noisy_and_the_observation_shows_nothing_else():
    preset = load_preset("ureteroscope").replace(sensor_latency=5 * T)
    clean, noisy = (short(preset=preset, noise_variance=variance, seconds=8.0) for variance in (0.0, 4.0))
    seen, smooth, bends, wanted, noise = [], [], [], [], []
    for environment in (clean, noisy):
        observation, info = environment.reset(seed=0)
        truncated = False
        while not truncated:
            if environment is clean:
                seen.append(observation[0] * ERROR_DEG)
                smooth.append(observation[1] * ERROR_DEG)
                bends.append(info["bend_deg"])
                wanted.append(info["reference_deg"])
            else:
                noise.append(observation[0] * ERROR_DEG - seen[len(noise)])
            observation, _, _, truncated, info = environment.step(STILL)
    late = np.concatenate([np.full(5, bends[0]), bends[:-5]])
    np.testing.assert_allclose(seen, late - wanted, atol=1e-5)
    share, low_passed = 1 - np.exp(-T / SMOOTHING_S), 0.0
    for error, shown in zip(seen, smooth, strict=True):
        low_passed += share * (error - low_passed)
        assert shown == pytest.approx(low_passed, abs=1e-4)
    assert np.std(noise) == pytest.approx(2.0, rel=0.1)


def test_a_law_that_is_linear_in_the_observation_tracks_far_better_than_the_line():
    worth = {}
    for gains in ((0.0, 0.0), (0.25, 0.3)):
        environment = TrackingEnvironment(physics="reduced")
        observation, _ = environment.reset(seed=1)
        errors, truncated = [], False
        while not truncated:
            action = -gains[0] * (observation[0] - observation[1]) - gains[1] * observation[1]
            observation, _, _, truncated, info = environment.step(np.array([action], np.float32))
            errors.append(info["bend_deg"] - info["reference_deg"])
        worth[gains] = np.sqrt(np.mean(np.square(errors)))
    assert worth[0.25, 0.3] < 0.5 * worth[0.0, 0.0]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"preset": "ureterscope"}, r"unknown preset .*ureterscope.*did you mean 'ureteroscope'"),
        ({"preset": load_preset("ureteroscope").replace(bending_planes=2)}, "two bending planes"),
        ({"stroke_mm": (1.0, -1.0)}, r"stroke \[1, -1\] mm: the first must be below the second"),
        ({"stroke_mm": (0.0, np.nan)}, r"stroke \[0, nan\] mm"),
        ({"speed_mm_s": 0.0}, "speed = 0 mm/s: must be positive"),
        ({"signals": ("sine", "square")}, "unknown reference 'square'; valid: sine"),
        ({"signals": ()}, "signals: at least one is needed; valid: sine"),
        ({"noise_variance": -1.0}, "gaussian noise of level -1.0"),
        ({"sample_time": -1.0}, "sample time -1 s: must be positive"),
        ({"seconds": 0.0}, "needs at least two samples"),
        ({"physics": "bullet"}, "unknown physics 'bullet'; valid: mujoco, reduced"),
        ({"render_mode": "human"}, "unknown render_mode 'human'; valid: None, rgb_array"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(wrong, message):
    with pytest.raises(InputError, match=message) as refused:
        short(**wrong)
    assert "\n" not in str(refused.value)
