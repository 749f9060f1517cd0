"""Quantities of an episode: where they stand in its file, and their statistics against those of NumPy."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import make_episode, messages

from twin.episode import Episode
from twin.recording import write_episode
from twin.recording.features import FEATURES, combine, describe_features, recorded, statistics

WIRES = "abcd"


def rich_episode(samples: int = 12, seed: int = 0) -> Episode:
    return make_episode(samples, seed=seed, planes=2, drive=True)


def told_by_numpy(values: np.ndarray) -> dict[str, float]:
    return {
        "count": values.size,
        "min": values.min(),
        "max": values.max(),
        "mean": values.mean(),
        "std": values.std(),
    }


def assert_close(told: dict[str, float], values: np.ndarray, rtol: float = 1e-8) -> None:
    expected = told_by_numpy(values)
    assert told.keys() == expected.keys()
    assert told["count"] == expected["count"]
    for key in ("min", "max", "mean", "std"):
        assert told[key] == pytest.approx(expected[key], rel=rtol, abs=rtol * np.abs(values).max())


def test_every_quantity_stands_in_the_file_where_it_is_said_to(tmp_path):
    episode = rich_episode()
    seen = messages(write_episode(tmp_path / "a.mcap", episode))
    described, held = describe_features(episode), recorded(episode)
    assert list(held) == [feature.name for feature in FEATURES]  # none is left out here
    for name, facts in described.items():
        message = seen[facts["topic"]][5][1]
        sample = held[name][5]
        assert list(sample.shape) == facts["shape"]
        if "*" in facts["field"]:
            found = [getattr(message, facts["field"].replace("*", wire)) for wire in WIRES]
        elif facts["field"] == "joints[].position":
            positions = [joint.position for joint in message.joints]
            half = len(positions) // 2
            found = positions[half:] if name.startswith("lateral") else positions[:half]
        else:
            found = getattr(message, facts["field"])
        np.testing.assert_allclose(np.array(found), sample, rtol=1e-12, err_msg=name)


def test_quantities_have_the_units_that_their_names_end_in():
    episode = rich_episode()
    held = recorded(episode)
    for name, values in {
        "pull_mm": 1e3 * episode.pull,
        "lateral_pull_mm": 1e3 * episode.lateral_pull,
        "pulley_mm": 1e3 * episode.pulley,
        "truth_deg": np.degrees(episode.bend),
        "lateral_bend_deg": np.degrees(episode.lateral_bend),
        "measured_deg": np.degrees(episode.measured_bend),
        "sheath_bend_deg": np.degrees(episode.sheath_bend),
        "wire_slack_mm": 1e3 * episode.wire_slack,
        "tension_n": episode.wire_tension[:, :, 0],
        "joint_angle_rad": episode.joint_angle,
    }.items():
        np.testing.assert_allclose(held[name], values, rtol=1e-15)


def test_what_was_not_recorded_is_not_described():
    bare = make_episode(vertebrae=0, elements=None)
    held = {"pull_mm", "measured_deg", "truth_deg"}
    assert set(recorded(bare)) == set(describe_features(bare)) == set(statistics(bare)) == held


def test_statistics_are_those_of_all_numbers_of_an_episode():
    episode = rich_episode(50)
    told = statistics(episode)
    assert told.keys() == recorded(episode).keys()
    for name, values in recorded(episode).items():
        assert_close(told[name], values)


def test_missing_measurements_are_not_counted():
    episode = make_episode(20)
    measured = episode.measured_bend.copy()
    measured[[0, 7, 19]] = np.nan
    told = statistics(dataclasses.replace(episode, measured_bend=measured))
    assert told["measured_deg"]["count"] == 17
    assert_close(told["measured_deg"], np.degrees(measured[~np.isnan(measured)]))
    assert told["truth_deg"]["count"] == 20


def test_quantity_that_is_missing_throughout_one_record_takes_no_part():
    episode, other = make_episode(20), make_episode(10, seed=1)
    blind = dataclasses.replace(episode, measured_bend=np.full(20, np.nan))
    assert "measured_deg" not in statistics(blind)
    for order in ((blind, other), (other, blind)):
        told = combine(statistics(one) for one in order)
        assert_close(told["measured_deg"], other.measured_deg)
        assert told["truth_deg"]["count"] == 30


numbers = st.floats(-1e6, 1e6, allow_subnormal=False)
parts_of_numbers = st.lists(st.lists(numbers, min_size=1, max_size=20), min_size=1, max_size=8)


def part(values: np.ndarray) -> dict[str, dict[str, float]]:
    return {"a": {key: float(value) for key, value in told_by_numpy(values).items()}}


@given(parts_of_numbers, st.randoms(use_true_random=False))
def test_statistics_of_parts_combine_to_those_of_the_whole_in_any_order_and_grouping(lists, random):
    whole = np.concatenate(lists)
    groups = [part(np.array(values)) for values in lists]
    random.shuffle(groups)
    while len(groups) > 1:  # some of them first, and what comes of it with the rest
        first = random.randrange(len(groups) - 1)
        last = random.randrange(first + 1, len(groups))
        groups[first : last + 1] = [combine(groups[first : last + 1])]
    (told,) = groups
    # Nine digits are kept at each step.
    assert_close(combine([told])["a"], whole, rtol=2e-8 * len(lists))


@given(parts_of_numbers)
def test_statistics_of_episodes_combine_to_those_of_all_their_samples(lists):
    def episode(pull: list[float]) -> Episode:
        whole = make_episode(len(pull) + 1)
        return dataclasses.replace(whole, pull=np.array([0.5, *pull]))

    episodes = [episode(pull) for pull in lists]
    told = combine(statistics(one) for one in episodes)
    for name in ("pull_mm", "truth_deg", "wire_tension_n"):
        together = np.concatenate([recorded(one)[name].ravel() for one in episodes])
        assert_close(told[name], together, rtol=1e-7)


def test_deviation_survives_a_mean_that_is_huge_beside_it():
    rng = np.random.default_rng(0)
    lists = [1e6 + 1e-2 * rng.standard_normal(500) for _ in range(6)]
    told = combine(part(values) for values in lists)["a"]
    assert told["std"] == pytest.approx(np.concatenate(lists).std(), rel=0.01)
    exact = combine(part(values - 1e6) for values in lists)["a"]
    assert exact["std"] == pytest.approx(np.concatenate(lists).std(), rel=1e-6)


def test_statistics_of_nothing_are_none():
    assert combine([]) == {}
