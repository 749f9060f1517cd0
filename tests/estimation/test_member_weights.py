"""Weights of the members of RAM (twins), against what its graph foretells when the members move."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_twins import small_step

from twin.estimation.estimator import Sensor
from twin.estimation.learned.ram_twins import STATE, MemberWeights, RamTwins
from twin.estimation.learned.step import ALL_PARTS, FILTER_ALONE, StepState
from twin.estimation.load import load_estimator

T = 0.1
MEMBERS = 6


@pytest.fixture(scope="module")
def ram(twins_policy) -> RamTwins:
    return load_estimator(twins_policy).with_sensor(Sensor(0.1))


@pytest.fixture(scope="module")
def found(ram) -> MemberWeights:
    return MemberWeights(ram)


@pytest.fixture(scope="module")
def states(ram) -> list[StepState]:
    """Filters that have seen a minute of an endoscope that is no member, ever more of it."""
    rng = np.random.default_rng(0)
    pull = 2.5 * np.sin(np.arange(600) * T)
    state = ram.start(pull[:1], np.zeros(1))
    kept = []
    for k in range(1, len(pull)):
        bend = 1.1 * state.following.of_filters()[0, 2] + 3.0
        measured = np.array([bend + rng.normal(0, 0.3)])
        state = ram.step(state, pull[k : k + 1], pull[k - 1 : k], measured)
        if k % 60 == 0:
            kept.append(state)
    return kept


def foretold(ram: RamTwins, state: StepState, members_deg: np.ndarray, parts) -> np.ndarray:
    """Prediction of the graph for these members, (B, M), where nothing is measured and the tendon rests."""
    batch = len(members_deg)
    memory = tuple(np.repeat(of, batch, axis=0) for of in state.memory)
    inputs = dataclasses.replace(ram, measurement_variance=0.1, parts=parts).constants(batch)
    inputs |= {"measurement_deg": np.full(batch, np.nan), "way_mm": np.zeros(batch)}
    return ram.network.step(memory, members_deg=members_deg, **inputs)[0]


def test_the_directions_are_those_of_the_trained_step_about_their_mean(found):
    trained = small_step().directions.numpy()[:, :-2]
    np.testing.assert_allclose(found.directions, trained - trained.mean(axis=0), atol=1e-7)
    np.testing.assert_allclose(found.directions.sum(axis=0), 0.0, atol=1e-12)


def test_the_weights_sum_to_one_and_differ(found, states):
    weights = np.array([found.of(state) for state in states])
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    assert np.ptp(weights, axis=1).min() > 0.01
    assert np.ptp(weights, axis=0).max() > 0.01


def test_a_filter_that_has_seen_nothing_gives_all_members_the_same(ram, found):
    begun = ram.start(np.array([0.5]), np.zeros(1))
    np.testing.assert_allclose(found.of(begun), 1 / MEMBERS, atol=1e-12)


@settings(max_examples=20)
@given(st.lists(st.floats(-30, 30), min_size=MEMBERS, max_size=MEMBERS), st.integers(0, 8))
def test_what_the_filter_foretells_changes_by_the_weighted_motion_of_the_members(ram, found, states, way, of):
    state = states[of]
    now = state.following.of_filters()
    weights, moved = found.of(state), np.array(way)
    before, after = foretold(ram, state, np.concatenate([now, now + moved]), ALL_PARTS)
    assert after - before == pytest.approx(weights @ moved, abs=1e-6)


@settings(max_examples=20)
@given(st.floats(-30, 30), st.integers(0, 8), st.sampled_from([ALL_PARTS, FILTER_ALONE]))
def test_what_all_members_go_together_the_whole_graph_goes_too(ram, states, way, of, parts):
    """The reason why weights sum to 1, with all that the graph says of the noise."""
    now = states[of].following.of_filters()
    before, after = foretold(ram, states[of], np.concatenate([now, now + way]), parts)
    assert after - before == pytest.approx(way, abs=1e-6)


def test_only_the_coefficients_of_the_members_and_the_laws_count(found, states):
    """Not what no member does, nor anything of the filter alone."""
    memory = dict(zip(STATE, (of.copy() for of in states[-1].memory), strict=True))
    memory["rows"][:, :, -2:] += 5.0
    others = {name: 0 * of for name, of in memory.items() if name not in ("rows", "evidence")}
    other = states[-1]._replace(memory=tuple((memory | others).values()))
    np.testing.assert_array_equal(found.of(other), found.of(states[-1]))
    memory["evidence"][:, 0] += 1000.0
    certain = 1 / MEMBERS + found.directions @ memory["rows"][0, 0, :-2]
    np.testing.assert_allclose(found.of(other._replace(memory=tuple(memory.values()))), certain, atol=1e-9)
