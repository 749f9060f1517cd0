"""Quantities of an episode: where they stand in its file, and their statistics against those of NumPy."""

import numpy as np
import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from hypothesis import given
from hypothesis import strategies as st
from recorded import make_episode, messages

from twin.episode import Episode
from twin.recording import write_episode
from twin.recording.endotwin_pb2 import DESCRIPTOR
from twin.recording.features import FEATURES, Feature, combine, describe_features, recorded, statistics
from twin.recording.messages import SCHEMAS

WIRES = "abcd"
OF_ESTIMATORS = {"Estimate", "Health"}
"""Messages that no episode holds."""


def rich_episode(samples: int = 12, seed: int = 0) -> Episode:
    return make_episode(samples, seed=seed, planes=2, drive=True)


def of_numpy(values: np.ndarray) -> dict[str, float]:
    return {
        "count": values.size,
        "min": values.min(),
        "max": values.max(),
        "mean": values.mean(),
        "std": values.std(),
    }


def assert_close(found: dict[str, float], values: np.ndarray, rtol: float = 1e-8) -> None:
    expected = of_numpy(values)
    assert found.keys() == expected.keys()
    assert found["count"] == expected["count"]
    for key in ("min", "max", "mean", "std"):
        assert found[key] == pytest.approx(expected[key], rel=rtol, abs=rtol * np.abs(values).max())


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


def test_statistics_are_those_of_all_numbers_of_an_episode():
    episode = rich_episode(50)
    found = statistics(episode)
    assert found.keys() == recorded(episode).keys()
    for name, values in recorded(episode).items():
        assert_close(found[name], values)


numbers = st.floats(-1e6, 1e6, allow_subnormal=False)
parts_of_numbers = st.lists(st.lists(numbers, min_size=1, max_size=20), min_size=1, max_size=8)


def part(values: np.ndarray) -> dict[str, dict[str, float]]:
    return {"a": {key: float(value) for key, value in of_numpy(values).items()}}


@given(parts_of_numbers, st.randoms(use_true_random=False))
def test_statistics_of_parts_combine_to_those_of_the_whole_in_any_order_and_grouping(lists, random):
    whole = np.concatenate(lists)
    groups = [part(np.array(values)) for values in lists]
    random.shuffle(groups)
    while len(groups) > 1:  # some of them first, and what comes of it with the rest
        first = random.randrange(len(groups) - 1)
        last = random.randrange(first + 1, len(groups))
        groups[first : last + 1] = [combine(groups[first : last + 1])]
    (found,) = groups
    # Nine digits are kept at each step.
    assert_close(combine([found])["a"], whole, rtol=2e-8 * len(lists))


def test_deviation_survives_a_mean_that_is_huge_next_to_it():
    rng = np.random.default_rng(0)
    lists = [1e6 + 1e-2 * rng.standard_normal(500) for _ in range(6)]
    found = combine(part(values) for values in lists)["a"]
    assert found["std"] == pytest.approx(np.concatenate(lists).std(), rel=0.01)
    exact = combine(part(values - 1e6) for values in lists)["a"]
    assert exact["std"] == pytest.approx(np.concatenate(lists).std(), rel=1e-6)


def fields_of(feature: Feature) -> list[str]:
    return [feature.field.replace("*", wire) for wire in WIRES] if "*" in feature.field else [feature.field]


def test_every_field_of_our_messages_is_a_quantity():
    wanted = {
        (SCHEMAS[feature.topic].DESCRIPTOR.name, field)
        for feature in FEATURES
        for field in fields_of(feature)
    }
    ours = {
        (message.name, field)
        for message in DESCRIPTOR.message_types_by_name.values()
        if message.name not in OF_ESTIMATORS
        for field in message.fields_by_name
    }
    assert ours == {(message, field) for message, field in wanted if message != JointStates.DESCRIPTOR.name}
