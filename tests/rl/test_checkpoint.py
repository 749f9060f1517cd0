"""A stopped training ends with the bytes of an undisturbed one; a checkpoint that is not ours is refused."""

import csv
import dataclasses
import shutil

import numpy as np
import pytest
from pickles import planted_pickle, planted_zip

from rl.checkpoint import CHECKPOINT, UPDATE, ReplayedEnvironment
from rl.options import TrainingOptions
from rl.policy import AGENTS
from rl.training import train_policy
from twin.estimation.active_model import ActiveModel
from twin.estimation.task import TrainingTask, stack_records
from twin.files import state_file
from twin.files.run_cost import COST_FILE
from twin.files.state_file import write_state

PLAN = TrainingOptions(episodes=48, environments=16, horizon=256, seed=3)
STATE = "checkpoint.state"


class _Stop(BaseException):
    pass


@pytest.fixture(scope="module")
def setting(model, records):
    return [(pull[:90], bend[:90]) for pull, bend in records], ActiveModel(model, 0.1)


def files(folder):
    """Contents by name, but for what the training took, which no two runs have the same of."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != COST_FILE}


@pytest.fixture(scope="module")
def undisturbed(setting, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    train_policy(*setting, PLAN, folder)
    return files(folder)


def stop_at(setting, folder, write, monkeypatch, plan=PLAN):
    """Train until the file is written for so many times: what is on the disk then is all that remains."""
    count = 0

    def counted(path, content):
        nonlocal count
        count += 1
        if count > write:
            raise _Stop
        write_whole(path, content)

    write_whole = state_file.write_whole
    with monkeypatch.context() as patch:
        for module in ("twin.files.state_file", "rl.run", "rl.export", "twin.files.run_folder"):
            patch.setattr(f"{module}.write_whole", counted)
        with pytest.raises(_Stop):
            train_policy(*setting, plan, folder)


@pytest.fixture
def stopped(setting, tmp_path, monkeypatch):
    stop_at(setting, tmp_path / "run", 9, monkeypatch)
    return tmp_path / "run"


@pytest.mark.parametrize("writes", [(0,), (2,), (4, 3, 4), (9,), (13,)])
def test_stopped_training_ends_with_the_bytes_of_an_undisturbed_one(
    setting, undisturbed, tmp_path, monkeypatch, writes
):
    for write in writes:
        stop_at(setting, tmp_path, write, monkeypatch)
    started = []
    train_policy(*setting, PLAN, tmp_path, lambda done, *_: started.append(done))
    assert files(tmp_path) == undisturbed
    if writes == (9,):
        assert started[0] > 16 * 89  # not from the beginning


LONGER = dataclasses.replace(PLAN, episodes=80)


def rows(folder):
    return (folder / "progress.csv").read_text().splitlines()


def test_a_finished_run_goes_on_where_more_episodes_are_asked_for(setting, undisturbed, tmp_path):
    train_policy(*setting, PLAN, tmp_path)
    shorter = rows(tmp_path)
    train_policy(*setting, LONGER, tmp_path)
    assert rows(tmp_path)[: len(shorter)] == shorter
    assert len(rows(tmp_path)) > len(shorter)
    longer = files(tmp_path)
    assert longer["policy.onnx"] != undisturbed["policy.onnx"]
    assert b"episodes: 80" in longer["config.yaml"]
    train_policy(*setting, LONGER, tmp_path)
    assert files(tmp_path) == longer


@pytest.mark.parametrize("write", [0, 1, 2, 5, 8])
def test_a_longer_run_that_is_stopped_ends_with_the_same_bytes(setting, tmp_path, monkeypatch, write):
    for name in ("whole", "stopped"):
        train_policy(*setting, PLAN, tmp_path / name)
    train_policy(*setting, LONGER, tmp_path / "whole")
    stop_at(setting, tmp_path / "stopped", write, monkeypatch, LONGER)
    train_policy(*setting, LONGER, tmp_path / "stopped")
    assert files(tmp_path / "stopped") == files(tmp_path / "whole")


@pytest.mark.parametrize("plan", [dict(episodes=1), dict(horizon=2048), dict(horizon=2048, episodes=64)])
def test_what_is_not_known_yet_is_kept_too(setting, tmp_path, monkeypatch, plan):
    """One update in all, or an episode that ends before the first."""
    short = dataclasses.replace(PLAN, **plan)
    longer = dataclasses.replace(short, episodes=short.episodes + 64)
    for name in ("whole", "stopped"):
        train_policy(*setting, short, tmp_path / name)
        assert all(row.split(",")[2] == "" for row in rows(tmp_path / name)[1:2])
    train_policy(*setting, longer, tmp_path / "whole")
    stop_at(setting, tmp_path / "stopped", 1, monkeypatch, longer)
    train_policy(*setting, longer, tmp_path / "stopped")
    assert files(tmp_path / "stopped") == files(tmp_path / "whole")


def test_a_run_that_cannot_go_on_stays_what_it_is(setting, tmp_path, monkeypatch):
    train_policy(*setting, PLAN, tmp_path)
    policy = (tmp_path / "policy.onnx").read_bytes()
    good = (tmp_path / STATE).read_bytes()
    (tmp_path / STATE).write_bytes(good[:-9])
    with pytest.raises(ValueError, match="damaged"):
        train_policy(*setting, LONGER, tmp_path)
    (tmp_path / STATE).write_bytes(good)
    with monkeypatch.context() as patch:
        patch.setattr("rl.training.__version__", "0.0.0")
        with pytest.raises(ValueError, match="is not of this version: choose another `folder`"):
            train_policy(*setting, LONGER, tmp_path)
    stop_at(setting, tmp_path, 5, monkeypatch, LONGER)
    assert (tmp_path / "policy.onnx").read_bytes() == policy
    train_policy(*setting, PLAN, tmp_path)  # stopped on its way, it is the shorter run still
    assert (tmp_path / "policy.onnx").read_bytes() == policy
    train_policy(*setting, LONGER, tmp_path)
    assert (tmp_path / "policy.onnx").read_bytes() != policy


def test_a_checkpoint_that_has_gone_further_is_not_taken_for_the_shorter_run(setting, tmp_path, monkeypatch):
    train_policy(*setting, PLAN, tmp_path)
    stop_at(setting, tmp_path, 5, monkeypatch, LONGER)
    (tmp_path / "policy.onnx").unlink()
    before = files(tmp_path)
    with pytest.raises(ValueError, match="has gone on to 6912 samples already: ask for more than 4272"):
        train_policy(*setting, PLAN, tmp_path)
    assert files(tmp_path) == before


def test_no_run_becomes_shorter_and_none_grows_without_its_checkpoint(setting, tmp_path):
    train_policy(*setting, PLAN, tmp_path)
    before = files(tmp_path)
    with pytest.raises(ValueError, match=r"another configuration \(training.episodes\)"):
        train_policy(*setting, dataclasses.replace(PLAN, episodes=16), tmp_path)
    with pytest.raises(ValueError, match=r"another configuration \(training.episodes, training.seed\)"):
        train_policy(*setting, dataclasses.replace(LONGER, seed=4), tmp_path)
    assert files(tmp_path) == before
    (tmp_path / STATE).unlink()
    with pytest.raises(ValueError, match=r"another configuration \(training.episodes\)"):
        train_policy(*setting, LONGER, tmp_path)
    assert "policy.onnx" in files(tmp_path)


def test_the_curve_tells_how_the_updates_went(setting, tmp_path):
    train_policy(*setting, LONGER, tmp_path)
    with (tmp_path / "progress.csv").open() as file:
        told = list(csv.DictReader(file))
    last = {name: float(value) for name, value in told[-1].items()}
    assert list(last)[2:8] == list(UPDATE)
    assert 0 <= last["kl"] < 1
    assert 0 <= last["clip_fraction"] <= 1
    # A normal law's entropy is that of its deviation.
    assert -last["entropy_loss"] == pytest.approx(
        2 * (0.5 + 0.5 * np.log(2 * np.pi) + np.log(last["exploration"])), rel=0.01
    )
    assert abs(last["action_1"]) < 1
    assert 0.3 < last["action_1_deviation"] < 1.2


@pytest.mark.parametrize("planted", [planted_pickle, planted_zip])
def test_planted_pickle_never_runs(setting, undisturbed, stopped, tmp_path, planted):
    witness = tmp_path / "it ran"
    (stopped / "checkpoints").mkdir()
    old = stopped / "checkpoints" / "0000001000.zip"  # where former versions looked
    old.write_bytes(planted(witness))
    shutil.move(stopped / STATE, tmp_path / "kept")
    (stopped / STATE).write_bytes(planted(witness))
    with pytest.raises(ValueError, match=rf"{STATE} is no training checkpoint of EndoTwin"):
        train_policy(*setting, PLAN, stopped)
    shutil.move(tmp_path / "kept", stopped / STATE)
    train_policy(*setting, PLAN, stopped)
    assert not witness.exists()
    shutil.rmtree(stopped / "checkpoints")
    assert files(stopped) == undisturbed


def with_arrays(path, change):
    """Write a state again, right but for what is changed: as somebody would who knows the format."""
    head = state_file.json.loads(path.read_bytes().partition(b"\n")[0])
    arrays = state_file.read_state(path, CHECKPOINT, head["key"])
    change(arrays)
    write_state(path, CHECKPOINT, head["key"], arrays)


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays: arrays.pop("counters"),
        lambda arrays: arrays.pop(next(name for name in arrays if name.startswith("weight"))),
        lambda arrays: arrays.update(counters=np.array([-1.0, 0, 1])),
        lambda arrays: arrays.update(counters=np.array([1e300, 0, 1])),
        lambda arrays: arrays.update(curve=np.zeros((2, 3))),
        lambda arrays: arrays.update(update=np.zeros(5)),
        lambda arrays: arrays.update(actions=np.zeros((1000, 16, 1))),
        lambda arrays: arrays.update({"weight log_std": np.zeros(7)}),
        lambda arrays: arrays.update({"weight log_std": np.full(1, np.nan)}),
    ],
)
def test_checkpoint_of_other_shapes_or_no_numbers_is_refused(setting, stopped, change):
    with_arrays(stopped / STATE, change)
    before = files(stopped)
    with pytest.raises(ValueError, match=f"{STATE} is damaged: remove it, and the run begins anew"):
        train_policy(*setting, PLAN, stopped)
    assert files(stopped) == before


def test_checkpoint_of_other_records_is_not_taken_up(setting, stopped, tmp_path):
    records, active_model = setting
    other = [(pull, np.where(np.arange(90) == 5, bend + 1, bend)) for pull, bend in records]
    shutil.copy(stopped / STATE, tmp_path / "kept")
    whole, mixed = tmp_path / "whole", tmp_path / "mixed"
    short = dataclasses.replace(PLAN, episodes=16)
    train_policy(other, active_model, short, whole)
    shutil.copytree(whole, mixed)
    (mixed / "policy.onnx").unlink()
    shutil.copy(tmp_path / "kept", mixed / STATE)
    train_policy(other, active_model, short, mixed)
    assert files(mixed) == files(whole)


@pytest.mark.parametrize("agent", AGENTS)
def test_replayed_actions_bring_an_environment_back(setting, agent):
    records, active_model = setting
    task = TrainingTask(*stack_records(records))
    first, second = (ReplayedEnvironment(task, AGENTS[agent](active_model), 3, 7, 0.5) for _ in range(2))
    rng = np.random.default_rng(0)

    def act(environment, action):
        return [np.asarray(value) for value in environment.step(action)[:3]]

    first.reset()
    for _ in range(100):  # past the end of a round
        act(first, rng.uniform(-1, 1, (3, len(first.agent.applied))).astype(np.float32))
    second.replay(first.rounds, np.array(first.actions_so_far, dtype=float))
    for _ in range(100):
        action = rng.uniform(-1, 1, (3, len(first.agent.applied))).astype(np.float32)
        for one, other in zip(act(first, action), act(second, action), strict=True):
            np.testing.assert_array_equal(one, other)
