"""Networks and learned gains next to a model, against filters by hand; what is said stays within bounds."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from small_twins import generator, small_memory_source

from rl.on_twins import RIVALS
from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences
from rl.twins.recurrent_step import GatedUnit, LearnedGain, RecursiveGain

SAMPLES = 30


def drawn(count=4, seed=3, noises=("gaussian", "poisson")):
    sequences = small_memory_source(noises).draw(count, SAMPLES, generator(seed), stride=5)
    measurement = sequences.measurement_deg.clone()
    measurement[10:13, 1] = torch.nan
    return sequences._replace(measurement_deg=measurement)


def says(kind, *numbers):
    """A step that says the same numbers at every sample."""
    torch.manual_seed(0)
    step = kind(GatedUnit, 12)
    with torch.no_grad():
        step.output[-1].weight.zero_()
        step.output[-1].bias.copy_(torch.tensor(numbers))
    return step.eval()


def run(step, sequences, parts=ALL):
    with torch.no_grad():
        return list(filter_sequences(step, sequences, parts))


def by_hand(sequences, row, of_theta, of_error):
    """Estimates of a filter of constant gains, from its first measurement on."""
    T = float(sequences.sample_time[row])
    theta, error, begun, found = 0.0, 0.0, False, []
    for keep, drive, y in zip(
        *(of[:, row].numpy() for of in sequences.inputs[:2]),
        sequences.measurement_deg[:, row].numpy(),
        strict=True,
    ):
        theta = keep * theta + drive + error * T
        if not np.isnan(y):
            theta, begun = (theta if begun else y), True
            innovation = y - theta
            theta, error = theta + of_theta * innovation, error + of_error * innovation
        found.append(theta)
    return np.array(found)


def test_constant_gains_are_a_filter_of_constant_gains():
    sequences = drawn()
    step = says(LearnedGain, 2 + np.log(0.3 / 0.7), 4 + np.log(0.1 / 0.9))  # gains of 0.3 and 0.2 / s
    outputs = torch.stack([output.bend_deg for output, _ in run(step, sequences)])
    for row in range(4):
        np.testing.assert_allclose(outputs[:, row], by_hand(sequences, row, 0.3, 0.2), atol=2e-3)


def of_logarithm(value):
    """The number of a network that stands for exp(value)."""
    return 6 * np.arctanh(value / 6)


def test_the_covariance_of_a_recursive_gain_is_that_of_joseph():
    """P <- (I - K H) F P F' (I - K H)' + L L', as matrices; without a measurement K is zero."""
    sequences = drawn()
    L = np.array([[0.5, 0.0], [0.7, 0.2]])
    numbers = of_logarithm(np.log(0.5)), 0.7, 3 + of_logarithm(np.log(0.2))
    step = says(RecursiveGain, 2 + np.log(0.3 / 0.7), 4 + np.log(0.1 / 0.9), *numbers)
    found = torch.stack([output.deviation_deg for output, _ in run(step, sequences)]) ** 2
    for row in range(4):
        P, wanted, T = np.diag([1.0, 0.0]), [], float(sequences.sample_time[row])
        of_row = sequences.inputs[0][:, row].tolist(), sequences.measurement_deg[:, row].tolist()
        for keep, y in zip(*of_row, strict=True):
            K = np.zeros(2) if np.isnan(y) else np.array([0.3, 0.2])
            step_of_error = (np.eye(2) - np.outer(K, [1, 0])) @ [[keep, T], [0, 1]]
            P = step_of_error @ P @ step_of_error.T + L @ L.T
            wanted.append(P[0, 0] * float(sequences.variance[row]))
        np.testing.assert_allclose(found[:, row], wanted, rtol=1e-3)


def test_a_recursive_gain_can_be_the_kalman_gain_and_its_variance_then_is_the_least():
    """Where L L' is what model and noise add, P is least in its steady state at the gain of Kalman."""
    sequences, growth = drawn(noises=("gaussian",)), 0.05
    spreads = {}
    for gain in (0.05, 0.2, 0.5):
        added = of_logarithm(np.log((1 - gain) ** 2 * growth + gain**2) / 2)
        step = says(RecursiveGain, 2 + np.log(gain / (1 - gain)), -20.0, added, 0.0, -100.0)
        *_, (output, _) = run(step, sequences._replace(inputs=tuple(of * 0 + 1 for of in sequences.inputs)))
        spreads[gain] = float((output.deviation_deg**2 / sequences.variance)[0])
    prior = growth / 2 + np.sqrt(growth**2 / 4 + growth)  # of the steady state, R = 1
    kalman = prior / (prior + 1)
    assert 0.15 < kalman < 0.25
    assert spreads[0.2] == pytest.approx(kalman, rel=0.05)
    assert spreads[0.2] == min(spreads.values())


@pytest.mark.parametrize("name", RIVALS)
def test_the_first_measurement_is_the_first_estimate_and_silence_changes_no_network(name):
    torch.manual_seed(0)
    step, sequences = RIVALS[name].untrained().eval(), drawn()
    outputs = run(step, sequences, 0 * ALL)
    np.testing.assert_allclose(outputs[0][0].bend_deg, sequences.measurement_deg[0], atol=1e-4)
    _, before = outputs[9]
    _, after = outputs[12]
    np.testing.assert_array_equal(before.hidden[1], after.hidden[1])
    np.testing.assert_array_equal(before.samples[1], after.samples[1])
    assert torch.isfinite(torch.stack([output.half_width_deg for output, _ in outputs])).all()


@given(seed=st.integers(0, 10_000), loud=st.floats(0.1, 20))
@pytest.mark.parametrize("kind", [LearnedGain, RecursiveGain])
def test_whatever_is_said_the_update_is_a_convex_step_and_the_variance_stays_positive(kind, seed, loud):
    torch.manual_seed(seed)
    step = kind(GatedUnit, 12)
    with torch.no_grad():
        step.output[-1].weight.normal_(0, loud)
    sequences = small_memory_source(("salt-and-pepper", "gamma")).draw(4, 12, generator(seed), stride=5)
    state = step.start(sequences.zero_deviation_deg)
    with torch.no_grad():
        for k in range(12):
            inputs, y = [of[k] for of in sequences.inputs], sequences.measurement_deg[k]
            rest = (sequences.variance, sequences.zero_deviation_deg, sequences.sample_time, ALL)
            _, unseen = step(*inputs, torch.full_like(y, torch.nan), *rest, state)
            output, state = step(*inputs, y, *rest, state)
            if k:
                low, high = torch.minimum(unseen.values[:, 0], y), torch.maximum(unseen.values[:, 0], y)
                assert (state.values[:, 0] >= low - 2e-3).all()
                assert (state.values[:, 0] <= high + 2e-3).all()
            assert (output.deviation_deg > 0).all()
            assert torch.isfinite(output.half_width_deg).all()
