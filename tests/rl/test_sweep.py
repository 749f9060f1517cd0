"""Trainings side by side, one for each seed, and their files as one method of a comparison."""

import dataclasses
import re

import numpy as np
import pytest
from distributed import Client, LocalCluster
from scores import simulated_record

from rl.comparison.given import given_files
from rl.options import TrainingOptions
from rl.sweep import folder_of, seeds_from, train_seeds
from rl.trainers import Material, find_trainer
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_method
from twin.evaluation.method import build_method, make_case
from twin.evaluation.protocol import Protocol
from twin.workers.processes import local_workers, shared_table

OPTIONS = TrainingOptions(agent="gru", episodes=7)
SEEDS = (3, 4)


@pytest.fixture(scope="module")
def material(records, model):
    return Material(records, ActiveModel(model, 0.1))


@pytest.fixture(scope="module")
def alone(material, tmp_path_factory):
    """The same trainings one after the other."""
    folder, paths = tmp_path_factory.mktemp("alone"), []
    for seed in SEEDS:
        options = dataclasses.replace(OPTIONS, seed=seed)
        paths.append(find_trainer("gru").run(material, options, folder / f"alone_{seed}"))
    return paths


@pytest.mark.slow
def test_side_by_side_they_are_those_that_run_alone(material, alone, tmp_path):
    reported = []
    with local_workers(2) as executor, shared_table() as shares:
        paths = train_seeds(
            material, OPTIONS, SEEDS, tmp_path / "sweep", executor, lambda *of: reported.append(of), shares
        )
        assert {place: share for place, (share, _) in shares.items()} == dict.fromkeys(range(2), 1.0)
        assert all(reward < 0 for _, reward in shares.values())
    assert paths == [folder_of(tmp_path / "sweep", seed) / "gru.onnx" for seed in SEEDS]
    assert [path.read_bytes() for path in paths] == [path.read_bytes() for path in alone]
    assert reported[-1][:2] == (2000, 2000)
    assert [done for done, *_ in reported] == sorted(done for done, *_ in reported)


def test_files_of_several_seeds_are_one_method(alone, records):
    files = given_files(alone, None, [0.1])
    assert files == {"gru": tuple(alone)}
    knowledge = Knowledge(0.1, {}, trained=files)
    method = build_method(find_method("GRU"), knowledge)
    pull, bend = records[0]
    record = simulated_record(pull, bend)
    case = make_case([(0, record)], Protocol("paper-only", 1))
    both = [ran.bend_deg for ran in method.run(case, 1, range(1, 5))]
    for path, estimate in zip(alone, both, strict=True):
        only = build_method(find_method("GRU"), dataclasses.replace(knowledge, trained={"gru": (path,)}))
        ((expected, *_),) = only.run(case, 1, range(1, 5))
        np.testing.assert_array_equal(estimate, expected)
    assert np.abs(both[0] - both[1]).max() > 1e-3


def test_files_that_are_no_trainings_of_one_method_are_refused(material, alone, tmp_path):
    other = dataclasses.replace(OPTIONS, episodes=14, seed=5)
    longer = find_trainer("gru").run(material, other, tmp_path / "longer")
    with pytest.raises(
        ValueError, match=r"longer.* is no other training of .*alone_3.*: they differ in iter"
    ):
        given_files([alone[0], longer], None, [0.1])
    with pytest.raises(ValueError, match=r"a second policy of the agent 'gru' and the seed 3"):
        given_files([alone[0], alone[1], alone[0]], None, [0.1])


@pytest.mark.parametrize(
    ("first", "count", "message"),
    [
        (0, 0, "seeds = 0: must be at least 1 and at most 100"),
        (0, 101, "seeds = 101: must be at least 1 and at most 100"),
        (2**32 - 2, 3, "seed = 4294967294: with 3 seeds it must be at most 4294967293"),
    ],
)
def test_seeds_that_are_out_of_range_are_refused(first, count, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        seeds_from(first, count)
    assert list(seeds_from(2**32 - 3, 3)) == [2**32 - 3, 2**32 - 2, 2**32 - 1]


@pytest.mark.slow
def test_a_cluster_trains_the_same(material, alone, tmp_path):
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        reported = []
        paths = train_seeds(
            material,
            OPTIONS,
            SEEDS,
            tmp_path / "sweep",
            client.get_executor(pure=False),
            lambda *of: reported.append(of),
        )
    assert [path.read_bytes() for path in paths] == [path.read_bytes() for path in alone]
    assert [done for done, *_ in reported] in ([1000, 2000], [2000])
