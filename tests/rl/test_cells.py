"""Cells of networks against torch's own convolution, a state space by hand, and a memory of zeros."""

import numpy as np
import pytest
import torch

from rl.twins.recurrent_step import Convolution, GatedUnit, LongShortTerm, StateSpace

CELLS = [GatedUnit, LongShortTerm, StateSpace, Convolution]
B, N, INPUTS = 3, 150, 5


def run(cell, seen):
    memory, said = torch.zeros(seen.shape[1], cell.size), []
    with torch.no_grad():
        for now in seen:
            out, memory = cell(now, memory)
            said.append(out)
    return torch.stack(said), memory


@pytest.fixture
def seen():
    return torch.randn(N, B, INPUTS, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize("kind", CELLS)
def test_sizes_are_as_said_and_each_row_is_on_its_own(kind, seen):
    torch.manual_seed(0)
    cell = kind(INPUTS, 12)
    said, memory = run(cell, seen)
    assert said.shape == (N, B, cell.width)
    assert memory.shape == (B, cell.size)
    alone, _ = run(cell, seen[:, 1:2])
    np.testing.assert_allclose(alone[:, 0], said[:, 1], atol=1e-5)


@pytest.mark.parametrize("kind", CELLS)
def test_the_past_matters_and_the_future_does_not(kind, seen):
    torch.manual_seed(0)
    cell, changed = kind(INPUTS, 12), seen.clone()
    changed[100] += 1.0
    said, other = run(cell, seen)[0], run(cell, changed)[0]
    np.testing.assert_array_equal(said[:100], other[:100])
    assert (said[101:110] - other[101:110]).abs().max() > 1e-4


def test_the_convolution_is_that_of_torch_with_zeros_before_the_first_sample(seen):
    torch.manual_seed(0)
    cell = Convolution(INPUTS, width=4, layers=5)
    said, _ = run(cell, seen)
    with torch.no_grad():
        now = torch.tanh(cell.before(seen)).permute(1, 2, 0)  # (B, width, N)
        for one, other, apart in zip(cell.now, cell.then, cell.apart, strict=True):
            kernel = torch.stack([other.weight, one.weight], dim=2)
            padded = torch.nn.functional.pad(now, (apart, 0))
            now = now + torch.tanh(torch.nn.functional.conv1d(padded, kernel, bias=one.bias, dilation=apart))
    np.testing.assert_allclose(said, now.permute(2, 0, 1), atol=1e-5)
    assert sum(cell.apart) == 31  # samples that it looks back


def test_the_state_space_is_its_equation(seen):
    """h_n <- exp(-dt a_n) h_n + dt b_n u and y = sum c_n h_n + d u, channel by channel."""
    torch.manual_seed(0)
    cell = StateSpace(INPUTS, width=3, states=2)
    said, _ = run(cell, seen)

    def of(layer, values):
        return values @ layer.weight.detach().numpy().T + layer.bias.detach().numpy()

    def sigmoid(values):
        return 1 / (1 + np.exp(-values))

    rates = np.exp(cell.log_rate.detach().numpy()).reshape(3, 2)
    h = np.zeros((3, 2))
    for k, row in enumerate(seen[:, 0].numpy()):
        raw, gate = of(cell.channels, row), of(cell.gate, row)
        u = raw * sigmoid(raw)
        dt, b, c = sigmoid(of(cell.step, u)), of(cell.into, u), of(cell.out, u)
        for w in range(3):
            for n in range(2):
                h[w, n] = np.exp(-dt[w] * rates[w, n]) * h[w, n] + dt[w] * b[n] * u[w]
        y = h @ c + cell.skip.detach().numpy() * u
        np.testing.assert_allclose(said[k, 0], y * gate * sigmoid(gate), atol=1e-5)
