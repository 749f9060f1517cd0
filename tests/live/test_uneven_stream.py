"""Streams whose samples do not come every T: each step spans the time that has passed."""

import dataclasses
import math

import numpy as np
import pytest
from controlled import DEPLOYMENT, PRESET, R
from hypothesis import example, given
from hypothesis import strategies as st
from models import COLEMAN_HODGDON
from small_twins import MODEL, TINY, small_memory_step

from rl.twins.graph import export_with_model
from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import AdaptiveActiveModel, BiasedActiveModel, InteractingModels
from twin.estimation.estimator import Sensor
from twin.estimation.load import load_estimator
from twin.hysteresis import model_to_dict
from twin.live.online import OnlineEstimator
from twin.preset import load_ranges
from twin.preset.preset import at_sample_time
from twin.reduced import simulate
from twin.reduced.members import MemberSet

T = 0.1
CAMERAS = [1 / 30, 1 / 59.94]
FILTER = ActiveModel(COLEMAN_HODGDON, T, (1e-3, 4e-2), R, (4.0, 1.0))
BIASED = BiasedActiveModel(**vars(FILTER), bias_variance=2.0, bias_process_variance=1e-3)
PREDICTING = {
    "plain numbers": FILTER,
    "biased": BIASED,
    "adaptive": AdaptiveActiveModel(FILTER),
    "interacting": InteractingModels((FILTER, FILTER)),
}


def uneven(seconds: float, seed: int = 0) -> np.ndarray:
    """Stamps (N,) that are up to 40 % of T off an even stream's step, in hundredths of a second [s]."""
    steps = np.random.default_rng(seed).integers(6, 15, round(seconds / T))
    return np.r_[0, np.cumsum(steps)] / 100


def live(estimator, time_s, pull_mm, measured_deg, first_deg=60.0):
    """Return the (N,) estimates [deg] of a stream, and the stream after it."""
    stream = OnlineEstimator(estimator, T, first_deg)
    columns = (of.tolist() for of in (time_s, pull_mm, measured_deg))
    return np.array([stream.push(*sample) for sample in zip(*columns, strict=True)]), stream


@pytest.mark.parametrize("estimator", [FILTER, BIASED], ids=["two states", "three states"])
def test_filter_is_the_textbook_one_of_each_time_step(estimator):
    """x_k = F_k x_k-1 + u_k and P_k = F_k P F_k^T + Q T_k / T, conditioned in information form."""
    time = uneven(10.0)
    pull = 3 + np.sin(time)
    measured = 60 + 20 * np.sin(time) + np.random.default_rng(1).normal(size=len(time))
    measured[20:40] = np.nan
    count = 3 if estimator is BIASED else 2
    row = np.array([1.0, 0.0, 1.0])[:count]
    x, P = np.array([60.0, 0.0, 0.0])[:count], np.diag([4.0, 1.0, 2.0][:count])
    a, b, c = dataclasses.astuple(COLEMAN_HODGDON)
    expected = [60.0]
    for k in range(1, len(time)):
        elapsed, moved = time[k] - time[k - 1], pull[k] - pull[k - 1]
        F = np.eye(count)
        F[0, :2] = 1 - a * abs(moved), elapsed
        x = F @ x
        x[0] += a * abs(moved) * b * pull[k] + c * moved
        P = F @ P @ F.T + np.diag([1e-3, 4e-2, 1e-3][:count]) * elapsed / T
        if np.isfinite(measured[k]):
            information = np.linalg.inv(P) + np.outer(row, row) / R
            before, P = P, np.linalg.inv(information)
            x = P @ (np.linalg.solve(before, x) + row * measured[k] / R)
        expected.append(x[0])
    estimate, stream = live(estimator, time, pull, measured)
    np.testing.assert_allclose(estimate, expected, rtol=1e-8)
    assert stream.half_width_deg == pytest.approx(1.959964 * math.sqrt(P[0, 0]), rel=1e-6)


STAMPS = {
    "even": np.arange(91) * T,
    "uneven": uneven(9.0),
    "30 Hz": np.arange(271) / 30,
    "30 Hz, then 10 Hz": np.r_[np.arange(180) / 30, 6 + np.arange(31) * T],
}


@pytest.mark.parametrize("estimator", PREDICTING.values(), ids=PREDICTING.keys())
def test_a_constant_error_of_the_model_is_predicted_for_the_time_that_passes(estimator):
    """The angle creeps by 2 deg/s on a still command; after 6 s nothing is measured."""
    for name, time in STAMPS.items():
        measured = np.where(time < 6, 60 + 2 * time, np.nan)
        pull = np.full(len(time), 3.0)
        estimate, _ = live(estimator, time, pull, measured)
        assert np.interp(8.5, time, estimate) == pytest.approx(77, abs=0.1), name
    counted, _ = live(estimator, np.arange(len(time)) * T, pull, measured)
    assert np.interp(8.5, time, counted) < 75  # f as if each sample of the camera had taken T


@pytest.mark.parametrize("estimator", PREDICTING.values(), ids=PREDICTING.keys())
@pytest.mark.parametrize("begin", [0.0, 1.8e9], ids=["small stamps", "seconds since 1970"])
def test_jitter_of_the_stamps_below_one_in_ten_thousand_changes_no_bit(estimator, begin):
    time = np.arange(200) * T
    pull = 3 + np.sin(time)
    measured = 60 + 20 * np.sin(time) + np.random.default_rng(2).normal(size=len(time))
    jitter = np.random.default_rng(3).uniform(-1, 1, len(time)) * 1e-7
    estimate, _ = live(estimator, begin + time + jitter, pull, measured)
    np.testing.assert_array_equal(estimate, estimator.estimate(pull, measured, 60.0)[0])


class Spanned(OnlineEstimator):
    """A stream that lists the times that its steps span [s]."""

    def __init__(self):
        super().__init__(FILTER, T, 60.0)
        self.spans_s, step = [], self.form.step

        def counting(state, pull_mm, previous_pull_mm, measurement_deg, elapsed_s=None):
            self.spans_s.append(T if elapsed_s is None else elapsed_s)
            return step(state, pull_mm, previous_pull_mm, measurement_deg, elapsed_s)

        self.form.step = counting


@given(
    st.lists(
        st.tuples(st.floats(1e-3, 0.6) | st.floats(1e-3, 10.0), st.floats(-2, 2)), min_size=1, max_size=20
    )
)
@example([(0.25, 2.0), (0.14, 0.0)])
def test_steps_add_up_to_the_time_of_the_stamps_in_gaps_and_long_moves(samples):
    stream, now, pull = Spanned(), 0.0, 3.0
    stream.push(now, pull, math.nan)
    for elapsed, move in samples:
        now += elapsed
        pull += move * min(0.2 + elapsed, 1.0)  # no implausible move: its samples would be repeated
        stream.push(now, pull, math.nan)
    assert min(stream.spans_s) > 0
    assert sum(stream.spans_s) == pytest.approx(now, rel=2e-4, abs=1e-12)


def test_no_more_than_ten_seconds_of_a_gap_are_predicted():
    stream = Spanned()
    stream.push(0.0, 3.0, math.nan)
    stream.push(4000.0, 3.0, math.nan)
    assert sum(stream.spans_s) == pytest.approx(10.0, abs=2 * T)


def test_what_was_trained_at_one_sample_time_counts_samples(ram_policy):
    estimator = load_estimator(ram_policy, Sensor(R))
    time = uneven(10.0)
    pull, measured = 3 + np.sin(time), 60 + 20 * np.sin(time)
    estimate, _ = live(estimator, time, pull, measured)
    np.testing.assert_array_equal(estimate, estimator.estimate(pull, measured, 60.0)[0])


@pytest.fixture(scope="module")
def memory(tmp_path_factory):
    path = tmp_path_factory.mktemp("memory") / "policy.onnx"
    export_with_model(
        small_memory_step(loud=0.5), {"agent": "ram-memory", "model": model_to_dict(MODEL)}, path
    )
    return load_estimator(path).with_sensor(Sensor(R))


@pytest.mark.parametrize("step_s", [0.04, 0.07, *CAMERAS])
@pytest.mark.parametrize("method", ["memory", "twins"])
def test_a_faster_stream_is_filtered_as_by_the_estimator_of_its_sample_time(
    method, step_s, memory, twins_policy
):
    """Control periods do not divide a camera's time: members are then half a period off their command."""
    estimator = memory if method == "memory" else load_estimator(twins_policy).with_sensor(Sensor(R))
    time = np.arange(200) * step_s
    pull = np.sin(time)
    measured = 20 * np.sin(time) + np.random.default_rng(4).normal(size=len(time))
    estimate, _ = live(dataclasses.replace(estimator, sample_time=T), time, pull, measured, 0.0)
    expected = estimator.at(step_s).estimate(pull, measured, 0.0)[0]
    np.testing.assert_allclose(estimate, expected, atol=1e-9 if method == "memory" else 0.02)


def jittered(time):
    """Return the places of samples that come up to 40 % of T early or late, in steps of 0.01 s."""
    at = np.round(uneven(time[-1]) * 100).astype(int)
    return at[at < len(time)]


def in_pairs(time):
    """Return the places of samples that come in pairs 0.01 s apart, one pair in 0.2 s."""
    at = np.cumsum(np.resize([19, 1], len(time)))
    return at[at < len(time)]


def errors_deg(estimator, presets, step_s, places=lambda time: np.arange(len(time))):
    """Return the RMSE over endoscopes by the stamps of their streams, and as if these were even [deg]."""
    real, counted = [], []
    for number, preset in enumerate(presets):
        time = np.arange(round(30 / step_s)) * step_s
        pull = 1.5 * np.sin(2 * np.pi * 0.1 * time) + 0.8 * np.sin(2 * np.pi * 0.27 * time)
        truth = simulate(at_sample_time(preset, step_s), pull * 1e-3, step_s).truth_deg
        at = places(time)
        time, pull, truth = time[at], pull[at], truth[at]
        measured = truth + math.sqrt(R) * np.random.default_rng(number).normal(size=len(truth))
        for errors, stamps in ((real, time), (counted, np.arange(len(time)) * T)):
            estimate, _ = live(estimator, stamps, pull, measured, float(truth[0]))
            errors.append((estimate - truth)[time > 3])
    return [float(np.sqrt(np.mean(np.concatenate(of) ** 2))) for of in (real, counted)]


@pytest.mark.parametrize(("places", "share"), [(jittered, 1.0), (in_pairs, 0.9)])
def test_the_fallback_is_nearer_to_the_truth_by_real_times(places, share):
    presets = [load_ranges("ureteroscope").draw(PRESET, np.random.default_rng(k)) for k in range(6)]
    real, counted = errors_deg(DEPLOYMENT.fallback_at(T, R), presets, 0.01, places)
    assert real < share * counted


@pytest.mark.parametrize("step_s", CAMERAS)
def test_the_fallback_of_a_camera_is_that_of_its_time(step_s):
    time = np.arange(300) * step_s
    pull = np.sin(time)
    measured = 20 * np.sin(time) + np.random.default_rng(5).normal(size=len(time))
    estimate, _ = live(DEPLOYMENT.fallback_at(T, R), time, pull, measured, 0.0)
    expected = DEPLOYMENT.fallback_at(step_s, R).estimate(pull, measured, 0.0)[0]
    np.testing.assert_allclose(estimate, expected, rtol=1e-9)


@pytest.mark.parametrize("step_s", CAMERAS)
def test_members_with_a_slow_servo_are_nearer_to_the_truth_by_real_times(step_s, twins_policy):
    """Members that count samples are at their command too early: a servo lags by 1 / gain."""
    slow = [PRESET.replace(servo_gain=4.0, sheath_friction=mu) for mu in np.linspace(0.2, 0.4, TINY.members)]
    estimator = load_estimator(twins_policy).with_sensor(Sensor(R))
    estimator = dataclasses.replace(estimator, sample_time=T, twins=MemberSet.still(slow))
    real, counted = errors_deg(estimator, [PRESET.replace(servo_gain=4.0, sheath_friction=0.3)], step_s)
    assert real < 0.8 * counted
