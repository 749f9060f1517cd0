"""The step of RAM (twins) against a Kalman filter in plain NumPy, and what holds for any policy."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from small_twins import TINY, generator, small_source, small_step

from rl.twins import step as law
from rl.twins.filter_step import ALL, NOTHING
from rl.twins.learning import filter_sequences
from rl.twins.recogniser import BINS, LAWS
from rl.twins.step import TwinsStep


def drawn(count=5, samples=30, seed=3, noises=("gaussian", "poisson")):
    return small_source(noises).draw(count, samples, generator(seed), stride=5)


def kalman_filter(members, way, measurement, variance, sample_time, directions):
    """Mean and covariance over time of X = [c, d, b] for one record, in the textbook's form."""
    count, rank = directions.shape
    mean = np.zeros(rank + 2)
    covariance = np.diag([*np.ones(rank), law.FIRST_ERROR_DEG2, law.FIRST_BIAS * variance])
    means, covariances, predictions = [], [], []
    for now, gone, y in zip(members, way, measurement, strict=True):
        transition = np.eye(rank + 2)
        transition[rank, rank] = np.exp(-gone / law.MEMORY_MM)
        process = np.zeros((rank + 2, rank + 2))
        process[range(rank), range(rank)] = law.MEMBERS_PER_MM * gone
        process[rank, rank] = law.GROWTH_DEG2_PER_MM * gone + law.GROWTH_DEG2_PER_S * sample_time
        process[rank + 1, rank + 1] = law.BIAS_PER_S * sample_time * variance
        mean, covariance = transition @ mean, transition @ covariance @ transition.T + process
        seen_as = np.concatenate([(now - now.mean()) / np.sqrt(count - 1) @ directions, [1, 1]])
        predictions.append(now.mean() + seen_as @ mean)
        if not np.isnan(y):
            gain = covariance @ seen_as / (seen_as @ covariance @ seen_as + variance)
            mean = mean + gain * (y - predictions[-1])
            covariance = (np.eye(rank + 2) - np.outer(gain, seen_as)) @ covariance
        means.append(mean)
        covariances.append(covariance)
    return np.array(means), np.array(covariances)


def test_without_a_policy_it_is_the_kalman_filter():
    step, sequences = small_step(), drawn()
    measurement = sequences.measurement_deg.clone()
    measurement[10:13, 1] = torch.nan
    sequences = sequences._replace(measurement_deg=measurement)
    with torch.no_grad():
        states = [state for _, state in filter_sequences(step, sequences, NOTHING)]
    directions = step.directions.numpy().astype(float)[:, :-2] * np.sqrt(len(step.directions) - 1)
    for run in range(5):
        mean, covariance = kalman_filter(
            sequences.inputs[0][:, run].numpy().astype(float),
            sequences.inputs[1][:, run].numpy(),
            measurement[:, run].numpy(),
            float(sequences.variance[run]),
            float(sequences.sample_time[run]),
            directions,
        )
        np.testing.assert_allclose([state.mean[run] for state in states], mean, atol=2e-4)
        np.testing.assert_allclose([state.covariance[run] for state in states], covariance, atol=2e-4)


@given(seed=st.integers(0, 10_000), loud=st.floats(0.1, 20))
def test_whatever_the_policy_says_the_update_is_a_convex_step_and_variances_stay_positive(seed, loud):
    step = small_step(seed, loud=loud)
    sequences = drawn(4, 12, seed, ("salt-and-pepper", "gamma"))
    state = step.start(sequences.variance)
    rank = len(step.unit) - 2
    with torch.no_grad():
        for k in range(12):
            members, way = (of[k] for of in sequences.inputs)
            y, given_to = sequences.measurement_deg[k], (members, way)
            rest = (sequences.variance, sequences.sample_time, ALL)
            _, unseen = step(*given_to, torch.full_like(y, torch.nan), *rest, state)
            _, state = step(*given_to, y, *rest, state)
            middle = members.mean(dim=1)
            seen_as = (members - middle[:, None]) @ step.directions + step.of_error + step.of_bias
            before, after = (middle + (seen_as * of.mean).sum(dim=1) for of in (unseen, state))
            share = (after - before) / (y - before)
            assert ((share > -1e-3) & (share < 1 + 1e-3)).all()
            variances = torch.diagonal(state.covariance, dim1=1, dim2=2)
            assert (variances[:, : rank + 1] > 0).all()
            assert (torch.linalg.eigvalsh(state.covariance.double()) > -1e-4).all()


def test_a_policy_that_does_nothing_changes_nothing():
    silent, sequences = small_step(loud=0.0), drawn()
    with torch.no_grad():
        acting = [output.bend_deg for output, _ in filter_sequences(silent, sequences, ALL)]
        idle = [
            output.bend_deg for output, _ in filter_sequences(silent, sequences, torch.tensor([0.0, 1.0]))
        ]
    np.testing.assert_allclose(torch.stack(acting), torch.stack(idle), atol=1e-5)


def after_ten(step, limit):
    """Estimates and deviations from the tenth sample on, at a limit of what is familiar, from one state."""
    sequences = drawn()
    with torch.no_grad():
        *_, (_, state) = filter_sequences(small_step(loud=2.0), sequences.between(0, 10), ALL)
        step.guarded = limit is not None
        step.familiarity.level.fill_(limit or 1.0)
        rest = filter_sequences(step, sequences.between(10, 30), ALL, state)
        return torch.stack([torch.stack([output.bend_deg, output.deviation_deg]) for output, _ in rest])


def test_under_a_noise_that_training_never_met_nothing_learned_is_heard():
    other = small_step(loud=1.0)
    other.recogniser.laws[-1].bias.data += 1.0
    torch.testing.assert_close(
        after_ten(small_step(loud=2.0), 1e-9), after_ten(other, 1e-9), rtol=0, atol=1e-3
    )
    torch.testing.assert_close(after_ten(small_step(loud=2.0), 1e6), after_ten(small_step(loud=2.0), None))


def test_without_a_measurement_nothing_is_learned_of_the_noise():
    step, sequences = small_step(loud=1.0), drawn()
    with torch.no_grad():
        *_, (_, state) = filter_sequences(step, sequences, ALL)
        output, after = step(
            *(of[-1] for of in sequences.inputs),
            torch.full_like(sequences.measurement_deg[-1], torch.nan),
            sequences.variance,
            sequences.sample_time,
            ALL,
            state,
        )
    for name in ("counts", "samples", "statistics", "weights", "bias", "bias_variance"):
        np.testing.assert_array_equal(getattr(after, name), getattr(state, name))
    assert torch.isfinite(output.bend_deg).all()
    assert torch.isfinite(output.half_width_deg).all()


def test_weights_of_the_laws_are_the_posterior_of_counted_residuals():
    """Laws that are histograms: the weights are those of Bayes' rule on the bins of every residual."""
    step, rng = small_step(), generator(5)
    chance = rng.dirichlet(np.ones(BINS), size=LAWS)
    with torch.no_grad():
        step.recogniser.likelihood.zero_()
        step.recogniser.likelihood[0] = torch.as_tensor(np.log(chance).T)
        step.recogniser.laws[-1].weight.zero_()
        step.recogniser.laws[-1].bias[:LAWS] = 0
    bins = rng.choice(BINS, size=40, p=chance[7])
    counts = np.bincount(bins, minlength=BINS)
    with torch.no_grad():
        weights, *_ = step.recogniser(torch.as_tensor(counts[None], dtype=torch.float32), torch.zeros(1))
    likelihood = np.prod(chance[:, bins], axis=1)
    np.testing.assert_allclose(weights[0], likelihood / likelihood.sum(), atol=1e-3)
    assert weights[0].argmax() == 7


@given(residual=st.floats(-50, 50))
def test_a_residual_counts_once(residual):
    counted = small_step().recogniser.bins(torch.tensor([residual]), torch.zeros(1))
    assert counted.sum() == pytest.approx(1, abs=1e-5)
    assert (counted > 0).sum() <= 2


def test_a_recogniser_that_is_sure_removes_the_mean_of_the_noise():
    """Told b beyond doubt, the estimate is that of a filter whose measurements are free of it."""
    step, sequences = small_step(), drawn(3, 150, 8, ("gaussian",))
    bias = 2.0 * torch.sqrt(sequences.variance)
    with torch.no_grad():
        step.recogniser.laws[-1].weight.zero_()
        step.recogniser.laws[-1].bias.zero_()
        step.recogniser.laws[-1].bias[LAWS : 2 * LAWS] = 2.0
        step.recogniser.laws[-1].bias[2 * LAWS :] = -10.0
        shifted = sequences._replace(measurement_deg=sequences.measurement_deg + bias)
        *_, (output, _) = filter_sequences(step, shifted, torch.tensor([0.0, 1.0]))
        known: TwinsStep = small_step()
        known.load_state_dict(step.state_dict())
        known.recogniser.laws[-1].bias[LAWS : 2 * LAWS] = 0.0
        *_, (clean, _) = filter_sequences(known, sequences, torch.tensor([0.0, 1.0]))
    np.testing.assert_allclose(output.bend_deg, clean.bend_deg, atol=0.02)


def whole_and_without(**part):
    """Estimates of two steps with the same weights, one without a part."""
    estimates = []
    for chosen in ({}, part):
        torch.manual_seed(5)
        step = TwinsStep(small_step().directions[:, :-2] * (TINY.members - 1) ** 0.5, **chosen).eval()
        with torch.no_grad():
            step.policy[-1].weight.normal_(0, 1.0)
            outputs = [of for of, _ in filter_sequences(step, drawn(), ALL)]
            *_, (_, state) = filter_sequences(step, drawn(), ALL)
        estimates.append((torch.stack([of.bend_deg for of in outputs]), state, step))
    return estimates


def test_without_a_model_error_state_nothing_is_estimated_of_it():
    (whole, before, _), (bare, after, step) = whole_and_without(with_error=False)
    assert (before.mean @ step.of_error).abs().max() > 1e-2
    assert (after.mean @ step.of_error).abs().max() < 1e-4
    assert (whole - bare).abs().max() > 1e-3


def test_without_a_recogniser_what_was_counted_changes_nothing():
    """Whatever its laws are, the weights depend on R alone, and the estimate is the filter's."""
    (_, _, _), (bare, after, step) = whole_and_without(with_recogniser=False)
    weights, bias, _ = step.first_noise(drawn().variance)
    torch.testing.assert_close(after.weights, weights)
    torch.testing.assert_close(after.bias, bias)
    step.recogniser.likelihood.data.normal_(0, 5.0)
    with torch.no_grad():
        again = torch.stack([of.bend_deg for of, _ in filter_sequences(step, drawn(), ALL)])
    torch.testing.assert_close(again, bare)


def test_a_policy_without_layers_is_linear():
    step = whole_and_without(policy_layers=0)[1][2]
    one, other = torch.randn(2, 3, step.policy[-1].in_features)
    nothing = step.policy(torch.zeros_like(one))
    torch.testing.assert_close(
        step.policy(one + other) - nothing, step.policy(one) + step.policy(other) - 2 * nothing
    )
