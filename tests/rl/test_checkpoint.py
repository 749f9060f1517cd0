"""A stopped training continues from its checkpoint; a file that is no checkpoint is refused and never run."""

import dataclasses

import pytest
import torch
from pickles import planted_pickle, planted_zip

from rl.algorithms import EPOCHS
from rl.options import TrainingOptions
from rl.run import load_checkpoint, save_checkpoint
from rl.training import train_policy
from twin.estimation.active_model import ActiveModel

PLAN = TrainingOptions(episodes=48, environments=16, horizon=256, seed=3)
LONGER = dataclasses.replace(PLAN, episodes=80)
STATE = "checkpoint.state"


class _Stop(BaseException):
    pass


@pytest.fixture(scope="module")
def setting(model, records):
    return [(pull[:90], bend[:90]) for pull, bend in records], ActiveModel(model, 0.1)


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "cost.json"}


def rows(folder):
    return (folder / "progress.csv").read_text().splitlines()


def stop_after(setting, folder, samples, plan=PLAN):
    def stop(done, *_):
        if done >= samples:
            raise _Stop

    with pytest.raises(_Stop):
        train_policy(*setting, plan, folder, stop)


@pytest.fixture
def stopped(setting, tmp_path):
    stop_after(setting, tmp_path / "run", 2000)
    return tmp_path / "run"


def test_a_stopped_training_continues_with_its_network_optimiser_and_curve(setting, stopped):
    saved = torch.load(stopped / STATE, weights_only=True)["state"]
    steps = [int(of["step"]) for of in saved["policy.optimizer"]["state"].values()]
    assert 0 < saved["samples"] < 48 * 89
    assert (
        min(steps) == max(steps) == EPOCHS * 2 * saved["samples"] / 256
    )  # epochs and minibatches of each update
    begun = []
    train_policy(*setting, PLAN, stopped, lambda done, *_: begun.append(done))
    assert begun[0] > saved["samples"]
    again = torch.load(stopped / STATE, weights_only=True)["state"]
    assert again["curve"][: len(saved["curve"])] == saved["curve"]
    assert again["samples"] >= 48 * 89
    assert (stopped / "policy.onnx").is_file()


def test_a_finished_run_continues_where_more_episodes_are_requested(setting, tmp_path):
    train_policy(*setting, PLAN, tmp_path)
    shorter, policy = rows(tmp_path), (tmp_path / "policy.onnx").read_bytes()
    stop_after(setting, tmp_path, 0, LONGER)
    train_policy(*setting, PLAN, tmp_path)  # stopped on its way, it is still the shorter run
    assert (tmp_path / "policy.onnx").read_bytes() == policy
    train_policy(*setting, LONGER, tmp_path)
    assert rows(tmp_path)[: len(shorter)] == shorter
    assert len(rows(tmp_path)) > len(shorter)
    assert (tmp_path / "policy.onnx").read_bytes() != policy
    assert b"episodes: 80" in (tmp_path / "config.yaml").read_bytes()
    longer = files(tmp_path)
    train_policy(*setting, LONGER, tmp_path)
    assert files(tmp_path) == longer


@pytest.mark.slow
def test_no_run_becomes_shorter_and_none_grows_without_its_checkpoint(setting, tmp_path, monkeypatch):
    train_policy(*setting, PLAN, tmp_path)
    before = files(tmp_path)
    with pytest.raises(ValueError, match=r"another configuration \(training.episodes\)"):
        train_policy(*setting, dataclasses.replace(PLAN, episodes=16), tmp_path)
    with pytest.raises(ValueError, match=r"another configuration \(training.episodes, training.seed\)"):
        train_policy(*setting, dataclasses.replace(LONGER, seed=4), tmp_path)
    monkeypatch.setattr("rl.training.__version__", "0.0.0")
    with pytest.raises(ValueError, match="is not of this version: choose another `folder`"):
        train_policy(*setting, LONGER, tmp_path)
    assert files(tmp_path) == before
    (tmp_path / STATE).unlink()
    with pytest.raises(ValueError, match=r"another configuration \(training.episodes\)"):
        train_policy(*setting, LONGER, tmp_path)


@pytest.mark.parametrize("planted", [planted_pickle, planted_zip])
def test_a_planted_pickle_never_runs(setting, stopped, tmp_path, planted):
    witness = tmp_path / "it ran"
    (stopped / STATE).write_bytes(planted(witness))
    before = files(stopped)
    with pytest.raises(ValueError, match=rf"{STATE} is no checkpoint of this training, or damaged"):
        train_policy(*setting, PLAN, stopped)
    assert not witness.exists()
    assert files(stopped) == before


def test_a_damaged_checkpoint_is_refused_and_stays(setting, stopped):
    path = stopped / STATE
    good = path.read_bytes()
    saved = torch.load(path, weights_only=True)
    other = {**saved["state"], "policy": {"log_std": torch.zeros(7)}}
    save_checkpoint(path, saved["endotwin checkpoint"], other)
    for content in (path.read_bytes(), good[:-9], b"", b"{}"):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=f"{STATE} is no checkpoint of this training, or damaged"):
            train_policy(*setting, PLAN, stopped)
        assert path.read_bytes() == content


def test_a_checkpoint_of_another_run_is_not_taken(tmp_path):
    save_checkpoint(tmp_path / STATE, "one", {"samples": 3})
    assert load_checkpoint(tmp_path / STATE, "one") == {"samples": 3}
    assert load_checkpoint(tmp_path / STATE, "another") is None
    assert load_checkpoint(tmp_path / "absent", "one") is None
