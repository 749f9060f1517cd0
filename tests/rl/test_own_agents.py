"""Agents of a user's own: trained by any algorithm, deployed as the graph of a full step, and compared."""

import textwrap

import gymnasium
import numpy as np
import pytest
import torch
from faulty_stream import run_faulty
from gated import material_of

from rl.algorithms import ModuleObservation, RecurrentPolicy, modules_of
from rl.environment import EstimationEnvironment
from rl.options import TrainingOptions
from rl.training import ERROR_SCALES, train_policy, with_smaller_errors
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.load import load_estimator
from twin.gate import run_gate

SHORT = {"episodes": 4, "environments": 2, "horizon": 64, "minibatch": 32, "network": (8,), "seed": 1}
RECURRENT = """
    from sb3_contrib import RecurrentPPO
    def make_agent(environment, seed):
        small = {"lstm_hidden_size": 8, "n_lstm_layers": 2, "net_arch": [8]}
        return RecurrentPPO(
            "MlpLstmPolicy", environment, n_steps=32, batch_size=32, seed=seed, policy_kwargs=small
        )
"""
WRAPPED = """
    import gymnasium, torch
    from stable_baselines3 import SAC
    from rl.algorithms import ModuleObservation
    def wrap(environment):
        environment = ModuleObservation(environment, torch.nn.Sequential(torch.nn.Tanh()))
        return gymnasium.wrappers.TransformReward(environment, lambda reward: -abs(reward) ** 0.5)
    def make_agent(environment, seed):
        assert abs(environment.reset()).max() <= 1
        return SAC("MlpPolicy", environment, seed=seed, buffer_size=999, policy_kwargs={"net_arch": [8]})
"""
CONSTANT = """
    import torch
    class Constant(torch.nn.Module):
        def forward(self, observation):
            return 0 * observation + torch.tensor([0.5, -1.0])
    def make_agent(environment, seed):
        return Constant()
"""
PROGRAMS = [pytest.param(RECURRENT, marks=pytest.mark.slow), WRAPPED, CONSTANT]


def trained(records, model, folder, program="", **options):
    if program:
        folder.mkdir(exist_ok=True)
        (folder / "my_agent.py").write_text(textwrap.dedent(program))
        options["agent_file"] = str(folder / "my_agent.py")
    options = TrainingOptions(agent="ram", **SHORT | options)
    return train_policy(records, ActiveModel(model, 0.1), options, folder / "run")


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"algorithm": "sac"}, {"algorithm": "td3"}])
def test_other_algorithms_train_an_estimator(records, model, tmp_path, options):
    path = trained(records, model, tmp_path, **options)
    assert read_trained_file(path).agent == "own"
    estimator = load_estimator(path).with_sensor(Sensor(0.1))
    _, off = run_faulty(estimator, 0.1, 600, seed=1)
    assert max(off.values()) < 20, off


@pytest.mark.parametrize("program", PROGRAMS, ids=["recurrent", "wrapped", "module"])
def test_an_agent_file_becomes_an_estimator_that_restarts_from_its_run(records, model, tmp_path, program):
    path = trained(records, model, tmp_path, program)
    before = path.stat().st_mtime_ns
    assert trained(records, model, tmp_path, program) == path
    assert path.stat().st_mtime_ns == before
    pull, bend = records[0]
    assert np.isfinite(load_estimator(path, Sensor(0.1)).estimate(pull, bend, bend[0] + 5)).all()
    if program == RECURRENT:  # the one with a memory: the gate takes seconds
        held = {check.name for check in run_gate(material_of(path)).checks if check.holds}
        assert held >= {"graph as it was trained", "bounds under hostile inputs", "a number under faults"}
    with pytest.raises(ValueError, match=r"another configuration \(agent_file.sha256\)"):
        trained(records, model, tmp_path, program + "    # changed\n")


def test_a_module_acts_as_its_numbers_say(records, model, tmp_path):
    """An action of 0.5 is a gain of 3/4 on the residual, and one of -1 leaves the model's error alone."""
    path = trained(records, model, tmp_path, CONSTANT)
    pull, bend = records[0]
    filtered = ActiveModel(model, 0.1)
    state = filtered.start(pull[:1], bend[:1] + 5)
    state = filtered.step(state, pull[1:2], pull[:1], bend[1:2] + 1)
    expected = filtered.bend_deg(state) + 0.75 * (bend[1] + 1 - filtered.bend_deg(state))
    found = load_estimator(path, Sensor(0.1)).estimate(pull[:2], bend[:2] + np.array([0.0, 1.0]), bend[0] + 5)
    assert found[0, 1] == pytest.approx(expected[0])


def test_a_recurrent_policy_is_that_of_its_library(records, model):
    from sb3_contrib import RecurrentPPO
    from stable_baselines3.common.vec_env import DummyVecEnv

    agent = RecurrentPPO(
        "MlpLstmPolicy", DummyVecEnv([lambda: EstimationEnvironment(records, model)]), n_steps=8, seed=1
    )
    policy, state = RecurrentPolicy(agent.policy), None
    memory = [torch.zeros(1, size) for size in policy.memory]
    for k in range(6):
        seen = np.array([[np.sin(k)]], np.float32)
        wanted, state = agent.predict(seen, state, np.array([k == 0]), deterministic=True)
        with torch.no_grad():
            action, *memory = policy(torch.as_tensor(seen), *memory)
        np.testing.assert_allclose(action.clamp(-1, 1), wanted, atol=1e-6)


def test_a_wrapper_that_cannot_be_deployed_is_refused():
    environment = ModuleObservation(EstimationEnvironment(), torch.nn.Identity())
    assert [type(module) for module in modules_of(environment)] == [torch.nn.Identity]
    with pytest.raises(ValueError, match="TransformObservation cannot be deployed"):
        modules_of(gymnasium.wrappers.TransformObservation(environment, lambda seen: 2 * seen, None))


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("x = 1", "defines no make_agent"),
        ("def make_agent(environment, seed):\n    return 3", "make_agent returned int: must be"),
        (CONSTANT.replace("0 * observation", "observation.new_zeros(len(observation), 1)"), "operator Shape"),
        ("def make_agent(environment, seed):\n    return 1 / 0", "line 2: ZeroDivisionError: division"),
        ("raise OSError('no disk')", r"agent file .*my_agent.py, line 1: OSError: no disk"),
    ],
)
def test_a_mistake_in_an_agent_file_is_one_line(records, model, tmp_path, program, message):
    with pytest.raises(ValueError, match=message):
        trained(records, model, tmp_path, program)
    assert not (tmp_path / "run/policy.onnx").exists()


def test_records_are_met_with_smaller_errors_of_the_model_too(records, model):
    pull, bend = (np.stack(of) for of in zip(*records, strict=True))
    pulls, bends = with_smaller_errors(model, pull, bend, 0.25)
    assert len(pulls) == len(bends) == ERROR_SCALES * len(pull)
    np.testing.assert_allclose(bends[-len(bend) :], bend)
    np.testing.assert_allclose(bends[:, 0], np.tile(bend[:, 0], ERROR_SCALES))
    first = model.response(pull[0], bend[0, 0])
    np.testing.assert_allclose(bends[0] - first, 0.25 * (bend[0] - first), atol=1e-9)
    assert with_smaller_errors(model, pull, bend, 1.0)[1] is bend
