"""The step of RAM (twins) against a Kalman filter in plain NumPy, and what holds for any policy."""

import numpy as np
import torch
from small_twins import drawn, small_step
from textbook_filter import kalman_filter

from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences


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
