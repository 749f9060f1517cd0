"""Every deployed graph against the code that trained it, along a stream whose state is handed on.

`make endurance` compares a hundred thousand samples of each. Networks have weights as they are drawn: what is
compared is the export and the runtime, whatever was learned.
"""

import dataclasses

import numpy as np
import pytest
import torch
from exported import filtered_by_both
from models import COLEMAN_HODGDON
from small_twins import TINY, generator, small_memory_source, small_memory_step, small_source, small_step
from torch_network import TorchNetwork

from rl.environment import BatchEnvironment, TrainingTask
from rl.export import export_module
from rl.gru import GruNetwork
from rl.kalman_net import GainNetwork
from rl.lstm import LstmNetwork
from rl.options import TrainingOptions
from rl.policy import AGENTS, export_policy
from rl.recurrent_graph import export_recurrent
from rl.training import new_ppo
from rl.twins.graph import MemoryGraph, TwinsGraph, export_memory, export_twins
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator
from twin.estimation.learned import ram_memory, ram_twins
from twin.estimation.learned.direct import ANGLE_LIMIT_DEG, DIRECT
from twin.estimation.learned.gru import Gru
from twin.estimation.learned.kalman_net import FEATURES, KalmanNet
from twin.estimation.learned.lstm import LstmEstimator
from twin.estimation.learned.model_step import PREDICTED_BY
from twin.estimation.learned.policy import PolicyEstimator, load_policy
from twin.estimation.learned.recurrent import OnnxNetwork
from twin.estimation.learned.trained_file import read_trained_file

pytestmark = pytest.mark.usefixtures("own_exporter")
T = 0.1
LENGTHS = [300, pytest.param(100_000, marks=pytest.mark.endurance)]
SINGLE = 1e-5
"""Largest difference [deg], or share of an angle beyond 1 deg: single precision holds 1e-7 of one number."""


def stream(samples, seed=0):
    """Commands of two frequencies and noisy measurements of the paper's model, with some of them missing."""
    time = np.arange(samples) * T
    pull = 3 + 0.6 * np.sin(2 * np.pi * time / 8) + 0.4 * np.sin(2 * np.pi * time / 5.3)
    noise = generator(seed).normal(0, 0.5, samples)
    measurement = COLEMAN_HODGDON.response(pull, 60.0) + noise
    measurement[40:samples:97] = np.nan
    return pull[None], measurement[None]


def assert_alike(deployed, trained, samples):
    """Both run sample by sample, each on its own state."""
    pull, measurement = stream(samples)
    found, wanted = (Estimator.estimate(of, pull, measurement, 60.0) for of in (deployed, trained))
    assert np.isfinite(wanted).all()
    np.testing.assert_allclose(found, wanted, atol=SINGLE, rtol=0)


@pytest.mark.parametrize("samples", LENGTHS)
@pytest.mark.parametrize("method", ["gru", "lstm", "kalman-net"])
def test_recurrent_network(method, samples, tmp_path):
    torch.manual_seed(1)
    path = tmp_path / "network.onnx"
    if method == "kalman-net":
        network = GainNetwork(16)
        export_module(
            network,
            {"seen": torch.zeros(2, FEATURES), "memory": torch.zeros(1, 2, network.hidden)},
            ["said", "remembered"],
            {"seen": [0], "memory": [1]},
            {"agent": method, "hidden": network.hidden},
            path,
        )
    else:
        network, states = (GruNetwork(32), 1) if method == "gru" else (LstmNetwork(32), 2)
        export_recurrent(network, states, method, {}, path)
    make = {
        "gru": lambda of: Gru(of, COLEMAN_HODGDON, T),
        "lstm": lambda of: LstmEstimator(of, T),
        "kalman-net": lambda of: KalmanNet(of, COLEMAN_HODGDON, T),
    }[method]
    deployed = make(OnnxNetwork(read_trained_file(path)))
    assert_alike(deployed, make(TorchNetwork(network.eval(), network.hidden)), samples)


def learn_to_follow(policy):
    """Teach direct RL to take half of a residual away, on the logarithmic scales of both."""
    optimiser = torch.optim.Adam(policy.parameters(), 3e-3)
    rng = torch.Generator().manual_seed(0)
    for _ in range(300):
        seen = torch.randn(256, 2, generator=rng) * torch.tensor([2.0, 0.5])
        residual = torch.sign(seen[:, 0]) * torch.expm1(torch.abs(seen[:, 0]))
        wanted = torch.sign(residual) * torch.log1p(torch.abs(residual) / 2) / np.log1p(ANGLE_LIMIT_DEG)
        action = policy.action_net(policy.mlp_extractor.policy_net(seen))[:, 0]
        optimiser.zero_grad()
        ((action - wanted) ** 2).mean().backward()
        optimiser.step()


@pytest.mark.parametrize("samples", LENGTHS)
@pytest.mark.parametrize("agent", [name for name in AGENTS if name])
def test_policy(agent, samples, tmp_path):
    """The policy of stable-baselines3 on `Agent.observe` and `Agent.act`, as its environment runs it."""
    active_model, kind = ActiveModel(COLEMAN_HODGDON, T), AGENTS[agent]
    options = TrainingOptions(agent=agent, environments=2, horizon=8, minibatch=8, seed=3)
    pull, measurement = (np.nan_to_num(of, nan=60.0) for of in stream(20))
    ppo = new_ppo(
        BatchEnvironment(TrainingTask(pull, measurement), kind(active_model), 2, 3, options.reward_scale),
        options,
    )
    torch.nn.init.normal_(ppo.policy.action_net.weight, std=0.3)
    if agent == DIRECT.agent:  # without feedback it adds up what its roundings differ by
        learn_to_follow(ppo.policy)
    export_policy(ppo, agent, {"active_model": active_model.to_dict()}, tmp_path / "policy.onnx")

    def trained(sensed):
        action, _ = ppo.predict(kind.scaled(sensed).astype(np.float32), deterministic=True)
        return kind.amounts(action.astype(float))

    deployed = PolicyEstimator(load_policy(tmp_path / "policy.onnx"), active_model, kind)
    assert_alike(deployed, dataclasses.replace(deployed, policy=trained), samples)


@pytest.mark.parametrize("samples", LENGTHS)
@pytest.mark.parametrize("method", ["ram-twins", "ram-memory"])
@pytest.mark.parametrize("precision", [torch.float64, torch.float32], ids=["as deployed", "as trained"])
def test_filter_step(precision, method, samples, tmp_path):
    """A step learns in single precision and is deployed in double: within the rounding of the former.

    A filter adds up roundings of its covariance and of weighted members: 2e-5 to 4e-5 of an angle, by the
    processor, which do not grow with the length of the stream.
    """
    path = tmp_path / "policy.onnx"
    if method == "ram-twins":
        step, source = small_step(loud=0.3), small_source()
        graph, names = TwinsGraph(step), ("members_deg", "way_mm", *ram_twins.STATE)
        export_twins(step, TINY.members, {"agent": method}, path)
    else:
        step, source = small_memory_step(loud=0.3), small_memory_source()
        graph, names = MemoryGraph(step), (*PREDICTED_BY, *ram_memory.STATE)
        export_memory(step, {"agent": method}, path)
    drawn = source.draw(1, 150, generator(3), stride=5)
    worst = max(
        float((abs(found - wanted) / (1 if precision == torch.float64 else np.maximum(abs(wanted), 1))).max())
        for found, wanted in filtered_by_both(
            graph, read_trained_file(path), names, drawn, samples, lambda k: k % 97 == 40, precision
        )
    )
    assert worst < (SINGLE / 10 if precision == torch.float64 else 10 * SINGLE)
