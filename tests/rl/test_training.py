import csv
import dataclasses
import re
import tempfile
from pathlib import Path

import pytest
import torch

from rl import training
from rl.algorithms import new_ppo
from rl.environment import make_batch
from rl.options import TrainingOptions
from rl.training import train_policy
from twin.estimation.active_model import ActiveModel
from twin.files.run_folder import COST_FILE, read_cost

SHORT = TrainingOptions(episodes=32, environments=16, horizon=512, seed=3)


@pytest.fixture(scope="module")
def active_model(model):
    return ActiveModel(model, 0.1)


@pytest.fixture(scope="module")
def run_folder(records, active_model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    train_policy(records, active_model, SHORT, folder)
    return folder


def returns(folder):
    with (folder / "progress.csv").open() as file:
        return [(int(row["samples"]), float(row["mean_reward"])) for row in csv.DictReader(file)]


def test_run_folder_holds_policy_configuration_and_curve(run_folder):
    assert {path.name for path in run_folder.iterdir()} == {
        "policy.onnx",
        "config.yaml",
        "progress.csv",
        "checkpoint.state",
        "cost.json",
    }
    assert read_cost(run_folder) > 0
    samples = [count for count, _ in returns(run_folder)]
    assert samples == sorted(set(samples))


def test_a_training_of_few_episodes_has_a_curve(records, active_model, tmp_path):
    train_policy(records, active_model, dataclasses.replace(SHORT, episodes=4), tmp_path)
    assert returns(tmp_path)


def test_same_seed_gives_the_same_bytes_and_leaves_nothing_elsewhere(
    records, active_model, run_folder, tmp_path, monkeypatch
):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    train_policy(records, active_model, SHORT, tmp_path / "run")
    for path in run_folder.iterdir():
        if path.name == COST_FILE:  # what it took, no two runs have the same of
            continue
        assert (tmp_path / "run" / path.name).read_bytes() == path.read_bytes(), path.name
    assert not [path for path in Path(tempfile.gettempdir()).iterdir() if path.name.startswith("SB3")]


def test_an_update_spans_as_much_time_at_any_sample_time(records, model, tmp_path):
    """At 50 Hz an update has five times the samples, and as many episodes in it."""
    options = dataclasses.replace(SHORT, episodes=8, horizon=128, minibatch=32)
    train_policy(records, ActiveModel(model, 0.02), options, tmp_path)
    with (tmp_path / "progress.csv").open() as file:
        *_, last = csv.DictReader(file)
    samples = 8 * (len(records[0][0]) - 1)
    assert int(last["samples"]) == -(-samples // 640) * 640
    assert options.at(0.1) == options


@pytest.mark.slow
def test_other_records_are_met_and_change_nothing(records, active_model, run_folder, tmp_path, monkeypatch):
    other = [(pull, bend + 1) for pull, bend in records]
    monkeypatch.setattr(training, "true_records", lambda paths, sample_time: other)
    train_policy(records, active_model, dataclasses.replace(SHORT, held_out="dev"), tmp_path)
    assert (tmp_path / "policy.onnx").read_bytes() == (run_folder / "policy.onnx").read_bytes()
    with (tmp_path / "progress.csv").open() as file:
        met = [float(row["eval/mean_reward"]) for row in csv.DictReader(file) if row["eval/mean_reward"]]
    assert len(met) == 3
    assert -1 < min(met) < max(met) < 0  # deg^2: R is 0.1


def test_the_learning_rate_is_constant_in_the_first_half_and_falls_to_zero(records, active_model):
    ppo = new_ppo(make_batch(16, records, active_model.model), SHORT)
    assert [ppo.lr_schedule(left) for left in (1, 0.5, 0.25, 0)] == [2.5e-4, 2.5e-4, 1.25e-4, 0]


def test_finished_run_is_left_as_it_is(records, active_model, run_folder):
    before = (run_folder / "policy.onnx").stat().st_mtime_ns
    train_policy(records, active_model, SHORT, run_folder)
    assert (run_folder / "policy.onnx").stat().st_mtime_ns == before


def test_another_configuration_does_not_overwrite_a_run(records, active_model, run_folder):
    with pytest.raises(ValueError, match="another configuration"):
        train_policy(records, active_model, TrainingOptions(episodes=64), run_folder)


def test_training_that_diverges_says_so(records, active_model, tmp_path, monkeypatch):
    def spoiled(*args):
        ppo = fresh(*args)
        torch.nn.init.constant_(ppo.policy.action_net.weight, float("nan"))
        return ppo

    fresh = training.MAKERS["ppo"]
    monkeypatch.setitem(training.MAKERS, "ppo", spoiled)
    with pytest.raises(
        FloatingPointError, match="the training has diverged after 1024 samples: lower `learning"
    ):
        train_policy(records, active_model, SHORT, tmp_path)
    assert not (tmp_path / "policy.onnx").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"agent": "dqn"}, "valid: lstm, gru, kalman-net, direct, ram"),
        ({"episodes": 0}, "episodes = 0: must be at least 1 and at most 1e"),
        ({"episodes": 1e15}, "episodes = 1000000000000000.0: must be a whole number"),
        ({"episodes": 10**15}, "at most 1e"),
        ({"environments": 10**9, "horizon": 10**9}, "at most"),
        ({"horizon": 2**40}, "horizon = 1099511627776: must be at least 1 and at most"),
        ({"minibatch": 2**40}, "at most"),
        ({"seed": 2**32}, "at most"),
        *[
            ({name: value}, f"{name} = {value}: must be")
            for value in (float("nan"), float("inf"), -float("inf"), -1.0, 1e300)
            for name in (
                "learning_rate",
                "clip",
                "reward_scale",
                "noise_level",
                "initial_error_deg",
                "discount",
            )
        ],
        ({"discount": 1.5}, "discount = 1.5"),
        ({"environments": 30}, "horizon = 1024: must be a multiple"),
    ],
)
def test_training_that_cannot_run_is_refused(change, message):
    with pytest.raises(ValueError, match=re.escape(message)) as refused:
        TrainingOptions(**change)
    assert len(str(refused.value)) < 300
