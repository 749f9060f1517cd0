"""Policies that the gate must refuse, made in seconds, and brief searches."""

import pytest
import torch
from briefly import tune_filters
from gated import T, export_small, logs_on, material_of
from small_twins import twins
from stable_baselines3 import PPO

from rl.algorithms import policy_of
from rl.environment import BatchEnvironment
from rl.training import export_policy
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.hysteresis import ColemanHodgdon


@pytest.fixture(scope="session", autouse=True)
def brief():
    """Filters are tuned and models identified by few evaluations."""
    with pytest.MonkeyPatch.context() as patch:
        tune_filters(patch)
        patch.setattr("twin.gate.evidence.GENERATIONS", 12)
        yield


@pytest.fixture(scope="session")
def untrained_twins(tmp_path_factory):
    """RAM (twins) as it is before anything is learned."""
    return export_small(tmp_path_factory.mktemp("untrained") / "policy.onnx")


@pytest.fixture(scope="session")
def untrained(untrained_twins):
    """Its material, with a log: what several checks need is computed once."""
    return material_of(untrained_twins, logs_on(twins()[0], (-2.0, 3.0), count=1))


@pytest.fixture(scope="session")
def paper_policy(records, tmp_path_factory):
    """RAM of the paper, untrained."""
    active_model = ActiveModel(ColemanHodgdon(1.33, 22.3, 3.4), T)
    environment = BatchEnvironment(TrainingTask(*stack_records(records)), active_model, 2, 0)
    ppo = PPO("MlpPolicy", environment, seed=5, device="cpu")
    torch.nn.init.constant_(ppo.policy.action_net.bias, 0.01)  # exporters drop biases that are zero
    path = tmp_path_factory.mktemp("paper") / "policy.onnx"
    export_policy(policy_of(ppo), "ram", active_model, {"active_model": active_model.to_dict()}, path)
    return path
