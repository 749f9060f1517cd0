import csv
import shutil

import numpy as np
import onnxruntime
import pytest
from stable_baselines3 import PPO

from rl.options import TrainingOptions
from rl.policy import export_policy, load_policy
from rl.training import train_policy
from twin.estimation.active_model import ActiveModel

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


def test_run_folder_holds_policy_configuration_curve_and_checkpoints(run_folder):
    assert {path.name for path in run_folder.iterdir()} == {
        "policy.onnx",
        "config.yaml",
        "progress.csv",
        "checkpoints",
    }
    samples = [count for count, _ in returns(run_folder)]
    assert samples == sorted(set(samples))
    assert list((run_folder / "checkpoints").glob("*.zip"))
    assert not list(run_folder.glob(".*"))


def test_exported_policy_equals_the_network_that_was_trained(run_folder):
    ppo = PPO.load(sorted((run_folder / "checkpoints").glob("*.zip"))[-1], device="cpu")
    exported = run_folder / "again.onnx"
    export_policy(ppo, "ram", {"active_model": {}}, exported)
    observation = np.linspace(-3, 3, 50, dtype=np.float32)[:, None]
    expected, _ = ppo.predict(observation, deterministic=True)
    session = onnxruntime.InferenceSession(str(exported))
    for count in (1, 7, 50):  # any batch
        (action,) = session.run(None, {"observation": observation[:count]})
        np.testing.assert_allclose(action, expected[:count], atol=1e-6)
    exported.unlink()


def test_policy_carries_the_filter_that_it_was_trained_beside(run_folder, active_model):
    policy = load_policy(run_folder / "policy.onnx")
    assert policy.agent_name == "ram"
    assert policy.active_model == active_model


def test_training_improves_the_policy(records, active_model, tmp_path):
    longer = TrainingOptions(agent="direct", episodes=200, environments=16, horizon=512, seed=3)
    train_policy(records, active_model, longer, tmp_path)
    curve = [value for _, value in returns(tmp_path)]
    assert curve[-1] > 0.1 * curve[0]  # both negative: a tenth of the error that a random policy makes


def test_same_seed_gives_the_same_policy(records, active_model, run_folder, tmp_path):
    train_policy(records, active_model, SHORT, tmp_path)
    assert returns(tmp_path) == returns(run_folder)
    observation = np.linspace(-3, 3, 20)[:, None]
    first, second = (load_policy(folder / "policy.onnx")(observation) for folder in (run_folder, tmp_path))
    np.testing.assert_array_equal(first, second)


def test_finished_run_is_left_as_it_is(records, active_model, run_folder):
    before = (run_folder / "policy.onnx").stat().st_mtime_ns
    train_policy(records, active_model, SHORT, run_folder)
    assert (run_folder / "policy.onnx").stat().st_mtime_ns == before


def test_another_configuration_does_not_overwrite_a_run(records, active_model, run_folder):
    with pytest.raises(ValueError, match="another configuration"):
        train_policy(records, active_model, TrainingOptions(episodes=64), run_folder)


class _Stop(Exception):
    pass


def test_stopped_training_goes_on_from_its_newest_whole_checkpoint(records, active_model, tmp_path):
    plan = TrainingOptions(episodes=96, environments=16, horizon=512, seed=3)

    def stop_half_way(done, total, reward):
        if done > total / 2:
            raise _Stop

    with pytest.raises(_Stop):
        train_policy(records, active_model, plan, tmp_path, stop_half_way)
    assert not (tmp_path / "policy.onnx").exists()
    newest = sorted((tmp_path / "checkpoints").glob("*.zip"))[-1]
    newest.write_bytes(newest.read_bytes()[:1000])  # as a crash while writing elsewhere would leave it

    seen = []
    train_policy(records, active_model, plan, tmp_path, lambda done, total, reward: seen.append(done))
    assert (tmp_path / "policy.onnx").is_file()
    assert seen[0] > 16 * 199  # not from the beginning
    samples = [count for count, _ in returns(tmp_path)]
    assert samples == sorted(set(samples))
    shutil.rmtree(tmp_path / "checkpoints")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"agent": "dqn"}, "valid: lstm, gru, kalman-net, direct, ram"),
        ({"episodes": 0}, "episodes = 0: must be positive"),
        ({"discount": 1.5}, "discount = 1.5"),
        ({"environments": 30}, "horizon = 1024: must be a multiple"),
    ],
)
def test_training_that_cannot_run_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        TrainingOptions(**change)


def test_file_that_is_no_policy_is_refused(tmp_path):
    path = tmp_path / "policy.onnx"
    with pytest.raises(FileNotFoundError, match="endotwin train"):
        load_policy(path)
    path.write_bytes(b"not a network")
    with pytest.raises(ValueError, match="not a trained file written by"):
        load_policy(path)
