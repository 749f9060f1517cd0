"""Learned gains with their authors' sizes: units, optimiser and likelihood, against formulas by hand."""

import numpy as np
import pytest
import torch

from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences
from rl.twins.recurrent_step import VALUES
from scripts.benchmarks.linear_system import SPEED, LinearSource, sequences_of
from scripts.studies.learned_gains import PUBLISHED, AdaBelief, loss

STATES, MEASURED = 2, 1


def bodies(count=3, samples=12):
    return LinearSource().run(count, samples, np.random.default_rng(2))


def test_the_recurrent_units_are_those_of_the_authors():
    """KalmanNet has ten for each number of both covariances, Recursive KalmanNet ten for each output."""
    sizes = {name: published.untrained().cell.sizes for name, published in PUBLISHED.items()}
    assert sizes["KalmanNet"] == [10 * (STATES**2 + MEASURED**2)]
    assert sizes["Recursive KalmanNet"] == [10 * STATES * MEASURED, 10 * STATES * (STATES + 1) // 2]


def test_the_speed_of_a_body_is_the_way_that_follows():
    of = bodies()
    np.testing.assert_allclose(np.diff(of.place, axis=0), of.speed[:-1])


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_loss_is_that_of_both_states(name):
    torch.manual_seed(0)
    step, of = PUBLISHED[name].untrained(), bodies()
    with torch.no_grad():
        values = [state.values.double().numpy() for _, state in filter_sequences(step, sequences_of(of), ALL)]
        found = float(loss(step, of))
    wanted = []
    for k, of_sample in enumerate(values):
        for b, (theta, error, *rest) in enumerate(of_sample):
            off = np.array([theta - of.place[k, b], error + SPEED - of.speed[k, b]])
            if name == "KalmanNet":
                wanted.append(off @ off / STATES)
            else:
                first, both, last = rest[VALUES - 2 :]
                P = np.array([[first, both], [both, last]])
                wanted.append(off @ np.linalg.solve(P, off) + np.linalg.slogdet(P)[1])
    assert found == pytest.approx(np.mean(wanted), rel=1e-3)


def test_adabelief_takes_longer_steps_along_gradients_that_agree():
    """Of equal gradients the running mean is the gradient in the end; alternating ones have none."""

    def moved(gradients):
        value = torch.nn.Parameter(torch.zeros(1))
        optimiser = AdaBelief([value], lr=1e-3, weight_decay=0.0)
        for gradient in gradients:
            value.grad = torch.full((1,), gradient)
            optimiser.step()
        return value.item()

    assert moved([2.0]) == pytest.approx(-1e-3 / 0.9)
    assert moved([2.0] * 100) < -0.15  # of Adam 0.1
    assert abs(moved([2.0, -2.0] * 50)) < 2e-3
