"""The filter bank of RAM (twins) against filters in plain NumPy that know the noise model."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from small_twins import LAWS, drawn, normal_laws, small_step

from rl.twins.filter_bank import CAUTION, HISTORY, NARROWEST_DEG2
from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences

RECOGNISER_ALONE = torch.tensor([0.0, 1.0])


def kalman_filters(step, sequences, run, means, deviations, prior):
    """Angle, its deviation and the noise's mean over time of one record, by filters of one covariance."""
    members, way = (of[:, run].numpy().astype(float) for of in sequences.inputs)
    variance = float(sequences.variance[run])
    motion = step.motion
    directions = step.directions.numpy().astype(float)
    rows = np.zeros((len(means), directions.shape[1]))
    covariance = motion.first_covariance(torch.ones(1))[0].numpy().astype(float)
    evidence, found = np.zeros(len(means)), []
    for now, gone, y in zip(members, way, sequences.measurement_deg[:, run].numpy(), strict=True):
        middle = now.mean()
        angle = (now - middle) @ directions + motion.of_error.numpy()
        gone, time = torch.tensor([gone]), sequences.sample_time[run : run + 1]
        keep = motion.keep(gone)[0].numpy()
        growth = sum(of[0].numpy() for of in motion.growth(gone, time))
        rows, covariance = rows * keep, np.diag(keep) @ covariance @ np.diag(keep) + np.diag(growth)
        doubt = angle @ covariance @ angle
        innovation = y - middle - rows @ angle - means * np.sqrt(variance)
        whole = doubt + variance * deviations**2 + NARROWEST_DEG2
        evidence = evidence * (1 - 1 / HISTORY) + stats.norm.logpdf(innovation, scale=np.sqrt(whole))
        rows = rows + (innovation / whole)[:, None] * (covariance @ angle)
        weights = np.exp(prior + evidence - (prior + evidence).max())
        weights /= weights.sum()
        gain = covariance @ angle / (doubt + variance * (weights @ deviations**2 + CAUTION))
        covariance = covariance - np.outer(gain, covariance @ angle)
        offset = rows @ angle
        spread = angle @ covariance @ angle + weights @ (offset - weights @ offset) ** 2
        found.append([middle + weights @ offset, np.sqrt(spread), weights @ means])
    return np.array(found)


def test_with_normal_laws_it_is_a_bank_of_kalman_filters():
    """Three noise models among many that are far from anything measured."""
    step, sequences = small_step(), drawn()
    means, deviations = np.full(LAWS, 1000.0), np.full(LAWS, 1.0)
    means[:3], deviations[:3] = [0.0, 1.0, 1.5], [1.0, 0.6, 1.3]
    normal_laws(step, means, deviations)
    prior = np.array([0.0, 1.5, -1.5])
    with torch.no_grad():
        step.filter_bank.noise_models.prior[-1].bias[:3] = torch.as_tensor(prior)
        step.filter_bank.caution.fill_(np.log(CAUTION))
        outputs = [output for output, _ in filter_sequences(step, sequences, RECOGNISER_ALONE)]
    for run in range(5):
        wanted = kalman_filters(step, sequences, run, means[:3], deviations[:3], prior)
        found = [
            [float(of.bend_deg[run]), float(of.deviation_deg[run]), float(of.bias[run])] for of in outputs
        ]
        np.testing.assert_allclose(found, wanted, atol=5e-3)


def test_the_law_of_the_noise_is_recognised_and_its_mean_removed():
    """Two noise models of other widths and means, each under its own noise."""
    step, sequences = small_step(), drawn(40, 180, 8, ("gaussian",))
    means, deviations = np.full(LAWS, 1000.0), np.full(LAWS, 1.0)
    means[:2], deviations[:2] = [0.0, 2.0], [1.0, 0.3]
    normal_laws(step, means, deviations)
    root = torch.sqrt(sequences.variance)
    noise = sequences.measurement_deg - sequences.truth_deg
    narrow = sequences._replace(measurement_deg=sequences.truth_deg + 0.3 * noise + 2 * root)
    for measured, mean in ((sequences, 0.0), (narrow, 2.0)):
        with torch.no_grad():
            *_, (output, _) = filter_sequences(step, measured, RECOGNISER_ALONE)
        assert (output.bias - mean).abs().median() < 0.02


@given(seed=st.integers(0, 10_000), loud=st.floats(0.1, 20))
def test_whatever_the_policy_says_each_filter_takes_a_convex_step_towards_the_parts_of_its_law(seed, loud):
    step = small_step(seed, loud=loud)
    sequences = drawn(4, 12, seed, ("salt-and-pepper", "gamma"))
    state = step.start(sequences.variance)
    root = torch.sqrt(sequences.variance)[:, None, None]
    with torch.no_grad():
        place = step.filter_bank.noise_models(sequences.variance).place * root
        for k in range(12):
            members, way = (of[k] for of in sequences.inputs)
            y, rest = sequences.measurement_deg[k], (sequences.variance, sequences.sample_time, ALL)
            _, unseen = step(members, way, torch.full_like(y, torch.nan), *rest, state)
            _, state = step(members, way, y, *rest, state)
            middle = members.mean(dim=1)
            angle = (members - middle[:, None]) @ step.directions + step.motion.of_error
            before, after = (
                middle[:, None] + (of.rows * angle[:, None]).sum(dim=-1) for of in (unseen, state)
            )
            parts = y[:, None, None] - place
            low, high = (torch.minimum(parts.amin(-1), before), torch.maximum(parts.amax(-1), before))
            slack = 1e-3 * (1 + (high - low))
            assert ((after > low - slack) & (after < high + slack)).all()
            assert (torch.diagonal(state.rows_covariance, dim1=1, dim2=2) > 0).all()
            for covariance in (state.rows_covariance, state.covariance):
                assert (torch.linalg.eigvalsh(covariance.double()) > -1e-4).all()


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
    for name in ("counts", "samples", "statistics", "evidence"):
        np.testing.assert_array_equal(getattr(after, name), getattr(state, name))
    assert torch.isfinite(output.bend_deg).all()
    assert torch.isfinite(output.half_width_deg).all()
