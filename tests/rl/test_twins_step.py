"""The step of RAM (twins) against a Kalman filter in plain NumPy, and what holds for any policy."""

import numpy as np
import torch
from small_twins import drawn, small_step

from rl.twins import filter_step as motion
from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences


def kalman_filter(members, way, measurement, variance, deviation, sample_time, directions):
    """Mean and covariance over time of X = [c, d, b] for one record, in the textbook's form."""
    count, rank = directions.shape
    mean = np.zeros(rank + 2)
    covariance = np.diag([*np.ones(rank), motion.FIRST_ERROR_DEG2, deviation**2])
    means, covariances, predictions = [], [], []
    for now, gone, y in zip(members, way, measurement, strict=True):
        transition = np.eye(rank + 2)
        transition[rank, rank] = np.exp(-gone / motion.MEMORY_MM)
        process = np.zeros((rank + 2, rank + 2))
        process[range(rank), range(rank)] = motion.MEMBERS_PER_MM * gone
        process[rank, rank] = motion.GROWTH_DEG2_PER_MM * gone + motion.GROWTH_DEG2_PER_S * sample_time
        process[rank + 1, rank + 1] = motion.ZERO_PER_S * sample_time * deviation**2
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
        states = [state for _, state in filter_sequences(step, sequences, 0 * ALL)]
    directions = step.directions.numpy().astype(float)[:, :-2] * np.sqrt(len(step.directions) - 1)
    for run in range(5):
        mean, covariance = kalman_filter(
            sequences.inputs[0][:, run].numpy().astype(float),
            sequences.inputs[1][:, run].numpy(),
            measurement[:, run].numpy(),
            float(sequences.variance[run]),
            float(sequences.zero_deviation_deg[run]),
            float(sequences.sample_time[run]),
            directions,
        )
        np.testing.assert_allclose([state.mean[run] for state in states], mean, atol=2e-4)
        np.testing.assert_allclose([state.covariance[run] for state in states], covariance, atol=2e-4)


def after_ten(step, limit):
    """Estimates and deviations from the tenth sample on, at a limit of what is familiar, from one state."""
    sequences = drawn()
    with torch.no_grad():
        *_, (_, state) = filter_sequences(small_step(), sequences.between(0, 10), ALL)
        step.guarded = limit is not None
        step.ood_detector.level.fill_(limit or 1.0)
        rest = filter_sequences(step, sequences.between(10, 30), ALL, state)
        return torch.stack([torch.stack([output.bend_deg, output.deviation_deg]) for output, _ in rest])


def test_under_a_noise_that_training_never_met_nothing_learned_is_heard():
    other = small_step()
    other.filter_bank.noise_models.places.data[0, :, 0] += 1.0
    torch.testing.assert_close(after_ten(small_step(), 1e-9), after_ten(other, 1e-9), rtol=0, atol=1e-3)
    torch.testing.assert_close(after_ten(small_step(), 1e6), after_ten(small_step(), None))
    assert (after_ten(small_step(), 1e6) - after_ten(other, 1e6)).abs().max() > 1e-3
