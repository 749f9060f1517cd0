"""Policies that the gate must refuse, made in seconds."""

import pytest
from gated import T, export_small
from stable_baselines3 import PPO

from rl.environment import BatchEnvironment
from rl.policy import AGENTS, export_policy
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.hysteresis import ColemanHodgdon


@pytest.fixture(scope="session")
def untrained_twins(tmp_path_factory):
    """RAM (twins) as it is before anything is learned."""
    return export_small(tmp_path_factory.mktemp("untrained") / "policy.onnx")


@pytest.fixture(scope="session")
def loud_twins(tmp_path_factory):
    """The same with a policy whose every weight can be heard."""
    return export_small(tmp_path_factory.mktemp("loud") / "policy.onnx", loud=0.5)


@pytest.fixture(scope="session")
def paper_policy(records, tmp_path_factory):
    """RAM of the paper with a policy that nothing was taught to."""
    active_model = ActiveModel(ColemanHodgdon(1.33, 22.3, 3.4), T)
    environment = BatchEnvironment(TrainingTask(*stack_records(records)), AGENTS["ram"](active_model), 2, 0)
    ppo = PPO("MlpPolicy", environment, seed=5, device="cpu")
    path = tmp_path_factory.mktemp("paper") / "policy.onnx"
    export_policy(ppo, "ram", {"active_model": active_model.to_dict()}, path)
    return path
