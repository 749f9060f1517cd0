"""The filter bank of RAM (twins) against filters in plain NumPy that know the noise model."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from small_twins import MODELS, TINY, drawn, generator, normal_laws, shorter, small_step

from rl.twins.filter_bank import CAUTION, HISTORY, NARROWEST_DEG2
from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences, learn_noise_models
from rl.twins.noises import FAMILIES

RECOGNISER_ALONE = torch.tensor([0.0, 1.0])
SHAPES = [name for name in TINY.noises for _ in range(FAMILIES[name].shapes)]
SKEWED = {place for place, name in enumerate(SHAPES) if FAMILIES[name].skewed}


def given_to(sequences):
    """What a step is given besides members and measurement."""
    return sequences.variance, sequences.zero_deviation_deg, sequences.sample_time, ALL


def kalman_filters(step, sequences, run, deviations, prior):
    """Angle, its deviation and the sensor's zero over time of one record, by filters of one covariance."""
    members, way = (of[:, run].numpy().astype(float) for of in sequences.inputs)
    variance, unknown = float(sequences.variance[run]), sequences.zero_deviation_deg[run : run + 1]
    motion = step.motion
    directions = step.directions.numpy().astype(float)
    rows = np.zeros((len(deviations), directions.shape[1]))
    covariance = motion.first_covariance(unknown)[0].numpy().astype(float)
    weights, found = np.exp(prior) / np.exp(prior).sum(), []
    first = weights
    for now, gone, y in zip(members, way, sequences.measurement_deg[:, run].numpy(), strict=True):
        middle = now.mean()
        angle = (now - middle) @ directions + motion.of_error.numpy()
        seen_as = angle + motion.of_zero.numpy()
        gone, time = torch.tensor([gone]), sequences.sample_time[run : run + 1]
        keep = motion.keep(gone)[0].numpy()
        growth = motion.growth(gone, unknown, time)[0].numpy()
        rows, covariance = rows * keep, np.diag(keep) @ covariance @ np.diag(keep) + np.diag(growth)
        doubt = seen_as @ covariance @ seen_as
        innovation = y - middle - rows @ seen_as
        whole = doubt + variance * deviations**2 + NARROWEST_DEG2
        weights = weights * stats.norm.pdf(innovation, scale=np.sqrt(whole))
        weights /= weights.sum()
        weights = (1 - 1 / HISTORY) * weights + first / HISTORY
        rows = rows + (innovation / whole)[:, None] * (covariance @ seen_as)
        gain = covariance @ seen_as / (doubt + variance * (weights @ deviations**2 + CAUTION))
        covariance = covariance - np.outer(gain, covariance @ seen_as)
        offset = rows @ angle
        spread = angle @ covariance @ angle + weights @ (offset - weights @ offset) ** 2
        found.append([middle + weights @ offset, np.sqrt(spread), weights @ rows[:, -1] / np.sqrt(variance)])
    return np.array(found)


def test_with_normal_models_it_is_a_bank_of_kalman_filters():
    """Three widths, each of many noise models; the zero of the sensor is one more state of each filter."""
    step, sequences = small_step(), drawn(8)
    assert (sequences.zero_deviation_deg == 0).any()
    assert (sequences.zero_deviation_deg > 0).any()
    of_shape, shapes = [of.shape for of in MODELS], len(SHAPES)
    deviations = np.resize([1.0, 0.6, 1.3], shapes)[of_shape]
    normal_laws(step, deviations)
    scores = np.linspace(-1.5, 1.5, shapes)
    prior = scores[of_shape]
    with torch.no_grad():
        step.filter_bank.noise_models.prior[-1].bias.copy_(torch.as_tensor(scores))
        outputs = [output for output, _ in filter_sequences(step, sequences, RECOGNISER_ALONE)]
    for run in range(8):
        wanted = kalman_filters(step, sequences, run, deviations, prior)
        found = [
            [float(of.bend_deg[run]), float(of.deviation_deg[run]), float(of.bias[run])] for of in outputs
        ]
        np.testing.assert_allclose(found, wanted, atol=5e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_of_a_skewed_noise_a_calibrated_sensor_has_the_mean_zero(learned_step, side):
    """The side of its skew is recognised, and no mean inferred from it (the bank once subtracted one)."""
    sequences, count, samples = drawn(40, 180, 8, ("gaussian",)), 40, 180
    noise = side * (generator(8).gamma(2.0, np.sqrt(0.5), (samples, count)) - np.sqrt(2.0))
    truth = sequences.inputs[0].mean(dim=2)  # that of the members: what is left is the noise
    sequences = sequences._replace(
        truth_deg=truth,
        measurement_deg=truth + torch.as_tensor(noise).float(),
        variance=torch.ones(count),
        zero_deviation_deg=torch.zeros(count),
    )
    with torch.no_grad():
        *_, (output, state) = filter_sequences(learned_step, sequences, RECOGNISER_ALONE)
        belief = learned_step.filter_bank.believe(state.evidence, sequences.variance)
    assert (output.bias == 0).all()
    sides = torch.tensor([of.side * (of.shape in SKEWED) for of in MODELS])
    assert float((belief @ sides).mean()) * side > 0.5
    off = output.bend_deg - truth[-1]
    assert abs(float(off.mean())) < 0.2  # where a bank that infers a mean from a skew is off by sqrt(2)


@pytest.fixture(scope="module")
def learned_step():
    step = small_step()
    learn_noise_models(
        step.filter_bank.noise_models, shorter(noise_model_sequences=2048, noise_model_updates=400)
    )
    return step


@given(seed=st.integers(0, 10_000))
def test_each_filter_takes_a_convex_step_towards_the_parts_of_its_model(seed):
    step = small_step(seed)
    sequences = drawn(4, 12, seed, ("salt-and-pepper", "gamma"))
    state = step.start(sequences.zero_deviation_deg)
    with torch.no_grad():
        place = step.filter_bank.noise_models(sequences.variance).place
        place = place * torch.sqrt(sequences.variance)[:, None, None]
        for k in range(12):
            members, way = (of[k] for of in sequences.inputs)
            y, rest = sequences.measurement_deg[k], given_to(sequences)
            _, unseen = step(members, way, torch.full_like(y, torch.nan), *rest, state)
            _, state = step(members, way, y, *rest, state)
            middle = members.mean(dim=1)
            angle = (members - middle[:, None]) @ step.directions + step.motion.of_error + step.motion.of_zero
            before, after = (
                middle[:, None] + (of.rows * angle[:, None]).sum(dim=-1) for of in (unseen, state)
            )
            parts = y[:, None, None] - place
            low, high = (torch.minimum(parts.amin(-1), before), torch.maximum(parts.amax(-1), before))
            slack = 1e-3 * (1 + (high - low))
            assert ((after > low - slack) & (after < high + slack)).all()
            assert (torch.diagonal(state.rows_covariance, dim1=1, dim2=2) >= 0).all()
            for covariance in (state.rows_covariance, state.covariance):
                assert (torch.linalg.eigvalsh(covariance.double()) > -1e-4).all()


def test_without_a_measurement_nothing_is_learned_of_the_noise():
    step, sequences = small_step(), drawn()
    with torch.no_grad():
        *_, (_, state) = filter_sequences(step, sequences, ALL)
        output, after = step(
            *(of[-1] for of in sequences.inputs),
            torch.full_like(sequences.measurement_deg[-1], torch.nan),
            *given_to(sequences),
            state,
        )
    for name in ("counts", "samples", "statistics", "evidence"):
        np.testing.assert_allclose(getattr(after, name), getattr(state, name), rtol=1e-4, atol=1e-5)
    assert torch.isfinite(output.bend_deg).all()
    assert torch.isfinite(output.half_width_deg).all()
