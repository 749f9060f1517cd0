"""Rows of RAM (twins) without one of its parts, from one file: each is what remains of the method."""

import numpy as np
import pytest
from small_twins import TINY, small_members, small_step
from textbook_filter import kalman_filter

from rl.twins.graph import export_twins
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_method
from twin.reduced.members import members_to_dict

T = 0.1
STRANGE, FAMILIAR = 1e-9, 1e6  # limits of the divergence: every noise is unknown, and none
COMPLETE, NO_DETECTOR, ALONE = (
    f"RAM (twins){part}" for part in ("", ", filter and classifier", ", filter alone")
)


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    """Return the method of a name on a file whose detector has a limit; None: it has no detector."""

    def build(name, limit):
        path = tmp_path_factory.mktemp("parts") / "policy.onnx"
        step = small_step()
        step.guarded = limit is not None
        step.ood_detector.level.fill_(limit or 1.0)
        description = {"agent": "ram-twins", "members": members_to_dict(small_members())}
        export_twins(step, TINY.members, description, path)
        knowledge = Knowledge(T, {}, trained={"ram-twins": (path,)})
        return find_method(name).build(knowledge).with_sensor(Sensor(1.0, zero_deviation_deg=1.0))

    return build


def record():
    """Two runs of a twin that is no member under skewed noise: pull [mm] and measurement [deg]."""
    pull = 2.0 * np.sin(np.arange(80) * T)
    noise = np.random.default_rng(2).gamma(2.0, np.sqrt(0.5), (2, 80)) - np.sqrt(2.0)
    return np.tile(pull, (2, 1)), 12.0 * pull + noise


def estimated(estimator):
    return estimator.estimate(*record(), np.zeros(2))[:, 1:]


def test_without_its_detector_it_is_the_complete_method_where_the_noise_is_familiar(build):
    np.testing.assert_array_equal(
        estimated(build(NO_DETECTOR, FAMILIAR)), estimated(build(COMPLETE, FAMILIAR))
    )


def test_without_its_detector_it_heeds_the_classifier_under_unknown_noise_too(build):
    """As a file without a detector does, in batches and on a stream."""
    row, wanted = build(NO_DETECTOR, STRANGE), estimated(build(COMPLETE, None))
    np.testing.assert_allclose(estimated(row), wanted, atol=1e-9)
    pull, measurement = record()
    single = row.single()
    state, stream = single.start(pull[0, 0], 0.0), []
    for k in range(1, 80):
        state = single.step(state, pull[0, k], pull[0, k - 1], measurement[0, k])
        stream.append(single.bend_deg(state))
    np.testing.assert_allclose(stream, wanted[0], atol=1e-9)
    assert np.abs(estimated(build(COMPLETE, STRANGE)) - wanted).max() > 0.05


@pytest.mark.parametrize("limit", [STRANGE, FAMILIAR])
def test_alone_the_filter_is_that_of_kalman_whatever_the_classifier_makes_of_the_noise(build, limit):
    estimator, (pull, measurement) = build(ALONE, limit), record()
    following = estimator.members.start(pull[:1, 0])
    members = []
    for k in range(1, 80):
        following = estimator.members.step(following, pull[:1, k], T)
        members.append(following.of_filters()[0])
    directions = small_step().directions.numpy().astype(float)[:, :-2] * np.sqrt(TINY.members - 1)
    way = np.abs(np.diff(pull[0]))
    means, _ = kalman_filter(members, way, measurement[0, 1:], 1.0, 1.0, T, directions)
    wanted = [
        now.mean() + np.append((now - now.mean()) / np.sqrt(TINY.members - 1) @ directions, 1.0) @ mean[:-1]
        for now, mean in zip(members, means, strict=True)
    ]
    np.testing.assert_allclose(estimated(estimator)[0], wanted, atol=1e-3)
    assert np.abs(estimated(estimator) - estimated(build(COMPLETE, FAMILIAR))).max() > 0.05
