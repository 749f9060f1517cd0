"""RAM and direct RL: what an action does to the active model, sample by sample."""

import numpy as np
import pytest
import torch
from torch_network import Constant, as_estimator

from rl.export import export_step
from rl.policies import POLICY_STEPS, RamStep
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Case
from twin.estimation.learned.methods import DIRECT, RAM
from twin.estimation.learned.step import OracleRun
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.load import load_estimator
from twin.hysteresis import BoucWen
from twin.live.online import OnlineEstimator

SEEDS = 8


@pytest.fixture
def active_model(model):
    return ActiveModel(model, 0.1)


@pytest.fixture
def case(records):
    pull, bend = records[0]
    noise = np.random.default_rng(0).standard_normal((SEEDS, len(bend)))
    pulls = np.tile(pull, (SEEDS, 1))
    return Case(pulls, bend + noise, np.full(SEEDS, bend[0] + 20), Sensor(np.full(SEEDS, 1.0)))


def steered(active_model, *action, agent="ram"):
    """An estimator whose policy returns one action, whatever it sees."""
    return as_estimator(POLICY_STEPS[agent](active_model, Constant(*action)), active_model.model)


def filtered(estimator, case):
    return estimator.with_sensor(case.sensor).estimate(
        case.pull_mm, case.measurement_deg, case.initial_bend_deg
    )


@pytest.mark.parametrize("with_gap", [False, True])
def test_ram_without_a_second_gain_is_the_active_model(active_model, case, with_gap):
    if with_gap:
        case.measurement_deg[:4, 30:40] = np.nan
    expected = filtered(active_model, case)
    np.testing.assert_allclose(filtered(steered(active_model, -1.0, -1.0), case), expected, rtol=1e-9)


def test_ram_with_full_gain_is_the_measurement(active_model, case):
    ram = filtered(steered(active_model, 1.0, -1.0), case)
    np.testing.assert_allclose(ram[:, 1:], case.measurement_deg[:, 1:], atol=1e-9)


def test_every_ram_update_lies_between_the_active_model_and_the_measurement(active_model):
    step, rng = RamStep(active_model), torch.Generator().manual_seed(1)
    state = {name: torch.zeros(4, dtype=torch.float64) for name in step.state}
    for _ in range(50):
        y = 20 * torch.randn(4, generator=rng, dtype=torch.float64)
        values = {"keep": 0.9, "drive_deg": 1.0, "variance": 0.1, "sample_time": 0.1}
        inputs = {name: torch.full_like(y, of) for name, of in values.items()}
        observed = step.observe({**inputs, "measurement_deg": y, "reference_deg": y}, state)
        action = 2 * torch.rand(4, 2, generator=rng, dtype=torch.float64) - 1
        state = dict(zip(step.state, step.act(observed, action), strict=True))
        after = state["previous_deg"]
        assert (torch.minimum(observed.bend_deg, y) - 1e-9 <= after).all()
        assert (after <= torch.maximum(observed.bend_deg, y) + 1e-9).all()


def test_phi_is_seen_in_units_of_the_given_noise(active_model):
    step = RamStep(active_model)
    state = {name: torch.zeros(2, dtype=torch.float64) for name in step.state}
    one = torch.ones(2, dtype=torch.float64)
    variance = torch.tensor([0.1, 10.0], dtype=torch.float64)
    inputs = {"keep": one, "drive_deg": 0 * one, "sample_time": 0.1 * one, "variance": variance}
    observed = step.observe({**inputs, "measurement_deg": 20 * one, "reference_deg": 20 * one}, state)
    seen = torch.expm1(observed.observation[:, 0])
    np.testing.assert_allclose(seen * variance**0.5, observed.phi)
    assert seen[0] > seen[1]


def test_an_oracle_takes_its_residual_from_the_truth_and_needs_it(active_model, case, records):
    oracle = OracleRun(steered(active_model, 1.0, -1.0))
    with pytest.raises(ValueError, match="needs the truth"):
        oracle(case)
    truth = np.tile(records[0][1], (SEEDS, 1))
    shown = Case(case.pull_mm, case.measurement_deg, case.initial_bend_deg, case.sensor, truth_deg=truth)
    np.testing.assert_allclose(oracle(shown)[:, 1:], truth[:, 1:], atol=1e-9)
    silent = OracleRun(steered(active_model, -1.0, -1.0))
    np.testing.assert_allclose(silent(shown), filtered(active_model, case), rtol=1e-9)


@pytest.mark.parametrize(("agent", "action"), [("ram", (0.2, -0.4)), ("direct", (0.1,))])
def test_a_stream_gives_what_the_batch_gives(active_model, case, agent, action):
    estimator = steered(active_model, *action, agent=agent)
    measurement = case.measurement_deg[0].copy()
    measurement[[5, 6, 90]] = np.nan
    batch = estimator.estimate(case.pull_mm[0], measurement, case.initial_bend_deg[0])[0]
    live = OnlineEstimator(estimator, 0.1, case.initial_bend_deg[0])
    stream = [live.push(0.1 * k, case.pull_mm[0, k], measurement[k]) for k in range(len(measurement))]
    np.testing.assert_array_equal(stream, batch)
    assert np.isfinite(batch).all()


def network(step):
    torch.manual_seed(0)
    return torch.nn.Sequential(
        torch.nn.Linear(step.observations, 8), torch.nn.Tanh(), torch.nn.Linear(8, step.actions)
    )


@pytest.mark.parametrize("agent", POLICY_STEPS)
def test_the_exported_graph_is_the_step(active_model, case, tmp_path, agent):
    step = POLICY_STEPS[agent](active_model, None)
    step.policy = network(step)
    inputs = dict.fromkeys(step.inputs, ())
    path = tmp_path / "policy.onnx"
    description = {"agent": agent, "start": step.start, "active_model": active_model.to_dict()}
    export_step(step, inputs, dict.fromkeys(step.state, ()), description, path)
    case.measurement_deg[2, 40:50] = np.nan
    found = filtered(load_estimator(path), case)
    samples = 20 if agent == "direct" else None  # without feedback it sums up its roundings
    wanted = filtered(as_estimator(step, active_model.model), case)
    np.testing.assert_allclose(found[:, :samples], wanted[:, :samples], atol=1e-4)
    other = DIRECT if agent == "ram" else RAM
    with pytest.raises(ValueError, match=f"holds the agent '{agent}', not"):
        read_trained_file(path, other.training.agent)


def test_a_model_that_is_not_affine_is_refused():
    with pytest.raises(ValueError, match="not affine in the angle"):
        RamStep(ActiveModel(BoucWen(22.0, -12.0, 1.1, 1.0, 1.5), 0.1))
