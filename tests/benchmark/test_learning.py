"""Measurements of what learns, at small size: what is compared, and that it is the same work."""

import numpy as np
import pytest

from rl import benchmark
from rl.benchmark import OF_LEARNING, IdleEnvironment, one_command, one_sample
from rl.environment import PAPER_MODEL, BatchEnvironment, model_record
from twin.benchmark import control
from twin.benchmark.measurements import MEASUREMENTS, Size
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.ram import ReinforcementActiveModel
from twin.preset import load_preset


def test_an_idle_environment_has_the_spaces_and_the_episodes_of_the_real_one():
    agent = ReinforcementActiveModel(ActiveModel(PAPER_MODEL, 0.1))
    pull, bend = stack_records([model_record(PAPER_MODEL, 0.1)])
    ours, idle = (
        kind(TrainingTask(pull[:, :20], bend[:, :20]), agent, 3, 1)
        for kind in (BatchEnvironment, IdleEnvironment)
    )
    ends = []
    for environment in (ours, idle):
        first = environment.reset()
        told = [environment.step(np.zeros((3, *environment.action_space.shape))) for _ in range(40)]
        ends.append([done.tolist() for _, _, done, _ in told])
        assert all(now.shape == first.shape and now.dtype == first.dtype for now, *_ in told)
        assert all("terminal_observation" in info for _, _, done, infos in told if done[0] for info in infos)
    assert ends[0] == ends[1]
    assert not any(reward.any() for _, reward, *_ in told)


def test_both_learn_as_many_samples_and_their_times_are_compared(monkeypatch):
    monkeypatch.setattr(benchmark, "SAMPLES", benchmark.TrainingOptions.horizon)
    monkeypatch.setattr(benchmark, "in_turn", lambda ours, idle: (ours() and 3.0, idle() and 2.0))
    found = benchmark.ppo()
    whole = benchmark.WHOLE_TRAINING / benchmark.SAMPLES
    assert found["ppo_environment"].value == pytest.approx(3 * whole)
    assert found["ppo_environment"].ratio == pytest.approx(1.5)
    assert not found["ppo_environment"].holds
    assert found["ppo_time"].value == found["ppo_environment"].value


def test_one_sample_takes_a_positive_time():
    result = one_sample(load_preset("ureteroscope"), Size(amplitude=1e-3))
    assert 0.05 < result.value < 100
    assert result.holds == (result.value < 1)


def test_a_command_takes_a_positive_time_by_the_members_themselves(monkeypatch):
    monkeypatch.setattr(control, "SECONDS", 4.0)
    found = one_command(load_preset("ureteroscope"), Size(amplitude=1e-3))
    assert 0.05 < found["control_step"].value <= found["control_step_latest"].value
    assert "one step of control by the inverse of members, 100 % of them" in found["control_step"].name


def test_names_meet_no_others():
    assert not set(OF_LEARNING) & set(MEASUREMENTS)
