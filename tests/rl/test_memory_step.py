"""The step of RAM (memory) against a Kalman filter and torch's recurrent unit, and bounds for any policy."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from small_twins import MODEL, generator, small_memory_source, small_memory_step

from rl.twins import memory_step as memory
from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences


def drawn(count=5, samples=30, seed=3, noises=("gaussian", "poisson")):
    return small_memory_source(noises).draw(count, samples, generator(seed), stride=5)


def kalman_filter(keep, drive, increment, measurement, variance, T):
    """Mean and covariance over time of X = [theta, f] for one record, in the textbook's form (eqs. 4-9)."""
    mean, covariance = np.zeros(2), np.diag(memory.FIRST_DEG2)
    means, covariances = [], []
    for kept, added, way, y in zip(keep, drive, np.abs(increment), measurement, strict=True):
        transition = np.array([[kept, T], [0.0, 1.0]])
        growth = np.diag([memory.GROWTH_DEG2_PER_MM * way + memory.GROWTH_PER_S * T, memory.GROWTH_PER_S * T])
        mean = transition @ mean + [added, 0]
        covariance = transition @ covariance @ transition.T + growth
        if not np.isnan(y):
            gain = covariance[:, 0] / (covariance[0, 0] + variance)
            mean = mean + gain * (y - mean[0])
            covariance = covariance - np.outer(gain, covariance[0])
        means.append(mean)
        covariances.append(covariance[[0, 0, 1], [0, 1, 1]])
    return np.array(means), np.array(covariances)


def test_without_a_policy_it_is_the_kalman_filter():
    step, sequences = small_memory_step(), drawn()
    measurement = sequences.measurement_deg.clone()
    measurement[10:13, 1] = torch.nan
    sequences = sequences._replace(measurement_deg=measurement)
    with torch.no_grad():
        states = [state for _, state in filter_sequences(step, sequences, 0 * ALL)]
    for run in range(5):
        mean, covariance = kalman_filter(
            *(of[:, run].numpy().astype(float) for of in sequences.inputs),
            measurement[:, run].numpy(),
            float(sequences.variance[run]),
            float(sequences.sample_time[run]),
        )
        np.testing.assert_allclose([state.mean[run] for state in states], mean, rtol=1e-4, atol=2e-3)
        np.testing.assert_allclose(
            [state.covariance[run] for state in states], covariance, rtol=2e-3, atol=2e-3
        )


def test_the_prediction_is_that_of_the_model():
    """Keep and drive along a command give the model's own response."""
    source = small_memory_source()
    pull = source.records[0].astype(float)
    index = np.arange(0, 41 * 5, 5)
    for command in range(len(pull)):
        keep, drive, _ = (
            of[:, 0].numpy() for of in source.predict(source.records, np.array([command]), index[:, None])
        )
        bend = [3.0]
        for kept, added in zip(keep, drive, strict=True):
            bend.append(kept * bend[-1] + added)
        np.testing.assert_allclose(bend, MODEL.response(pull[command, index], 3.0), rtol=1e-4, atol=1e-3)


def test_it_remembers_as_the_gated_recurrent_unit_of_torch():
    step, hidden = small_memory_step(), memory.HIDDEN
    other = torch.nn.GRUCell(memory.SEEN, hidden)
    with torch.no_grad():
        other.weight_ih.copy_(step.input.weight)
        other.bias_ih.copy_(step.input.bias)
        other.weight_hh.copy_(step.memory.weight)
        other.bias_hh.copy_(step.memory.bias)
        seen, before = torch.randn(7, memory.SEEN), torch.tanh(torch.randn(7, hidden))
        np.testing.assert_allclose(step._remember(seen, before), other(seen, before), atol=1e-6)


@given(seed=st.integers(0, 10_000), loud=st.floats(0.1, 20))
def test_whatever_the_policy_says_the_update_is_a_convex_step_and_variances_stay_positive(seed, loud):
    step = small_memory_step(seed, loud=loud)
    sequences = drawn(4, 12, seed, ("salt-and-pepper", "gamma"))
    state = step.start(sequences.zero_deviation_deg)
    with torch.no_grad():
        for k in range(12):
            inputs, y = [of[k] for of in sequences.inputs], sequences.measurement_deg[k]
            rest = (sequences.variance, sequences.zero_deviation_deg, sequences.sample_time, ALL)
            _, unseen = step(*inputs, torch.full_like(y, torch.nan), *rest, state)
            output, state = step(*inputs, y, *rest, state)
            share = (state.mean[:, 0] - unseen.mean[:, 0]) / (y - unseen.mean[:, 0])
            assert ((share > -1e-3) & (share < 1 + 1e-3)).all()
            p, cross, of_f = state.covariance.double().split(1, dim=1)
            assert (p > 0).all()
            assert (of_f > 0).all()
            assert (cross**2 <= p * of_f * (1 + 1e-4) + 1e-6).all()
            assert torch.isfinite(output.half_width_deg).all()


def after_one(step, **outputs):
    """Estimate of one sample, its prediction and innovation, where the policy outputs these numbers."""
    names = ("gain", "noise", "growth", "bias", "doubt")
    sequences = drawn()
    with torch.no_grad():
        step.output[-1].bias.copy_(torch.tensor([outputs.get(name, 0.0) for name in names]))
        *_, (_, state) = filter_sequences(step, sequences.between(0, 10), ALL)
        inputs, y = [of[10] for of in sequences.inputs], sequences.measurement_deg[10]
        rest = (sequences.variance, sequences.zero_deviation_deg, sequences.sample_time)
        unseen, _ = step(*inputs, torch.full_like(y, torch.nan), *rest, 0 * ALL, state)
        found, _ = step(*inputs, y, *rest, ALL, state)
    predicted = unseen.bend_deg
    return found.bend_deg.numpy(), predicted.numpy(), (y - predicted).numpy(), sequences.variance.numpy()


def test_a_policy_that_asks_for_more_gain_moves_further_and_a_positive_mean_is_subtracted():
    shares = []
    for gain in (-1.0, 0.0, 1.0):
        bend, predicted, innovation, _ = after_one(small_memory_step(), gain=gain)
        shares.append((bend - predicted) / innovation)
    assert (np.diff(shares, axis=0) > 0.01).all()
    with_mean, predicted, innovation, variance = after_one(small_memory_step(), bias=1.0)
    without, *_ = after_one(small_memory_step())
    mean = memory.LARGEST_BIAS * np.tanh(1 / memory.LARGEST_BIAS) * np.sqrt(variance)
    np.testing.assert_allclose(without - with_mean, mean, rtol=1e-3)
