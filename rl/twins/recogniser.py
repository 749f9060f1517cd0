"""Recogniser of the noise: laws that are weighed by counted residuals, each with a mean of its own.

Residuals in units of sqrt(R) are counted in a running histogram. The logarithm of the likelihood of a law is
linear in such counts; J learned laws are weighed by it (Bayes), and say together what the mean of the noise
is, which no filter that is told R alone can see.
"""

import torch

from rl.twins.networks import last_layer, network

Tensor = torch.Tensor

LAWS = 32  # J
BINS = 56
LARGEST_RESIDUAL = 3.9  # of the histogram's scale asinh(4 r): 6 sqrt(R)
HISTORY = 400.0  # samples after which the histogram forgets: as many as a recogniser has learned from


class Recogniser(torch.nn.Module):
    """Laws of the noise: log-likelihoods of a residual in each bin, and by R a prior, a mean and a width."""

    def __init__(self) -> None:
        super().__init__()
        self.centres = torch.nn.Buffer(torch.linspace(-LARGEST_RESIDUAL, LARGEST_RESIDUAL, BINS))
        self.likelihood = torch.nn.Parameter(torch.randn(3, BINS, LAWS) * 0.02)
        self.laws = network(1, 16, 3 * LAWS, layers=1)
        with torch.no_grad():
            last_layer(self.laws).bias[LAWS : 2 * LAWS] = torch.linspace(-0.3, 2.2, LAWS)

    def bins(self, residual: Tensor, doubt: Tensor) -> Tensor:
        """Return (..., BINS) what residuals in units of sqrt(R) count in the histogram.

        A residual is shared by the two nearest bins; one of a prediction that is in doubt counts less.

        Args:
            residual: (...) in units of sqrt(R).
            doubt: (...) variance of the prediction in units of R.
        """
        place = _arsinh(4 * residual).clamp(-LARGEST_RESIDUAL, LARGEST_RESIDUAL)
        between = 2 * LARGEST_RESIDUAL / (BINS - 1)
        share = (1 - (place[..., None] - self.centres).abs() / between).clamp(min=0)
        return share / (1 + doubt)[..., None]

    def forward(self, counts: Tensor, log_variance: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the weights of the laws (..., LAWS), and mean and variance of b in units of sqrt(R) and R.

        Args:
            counts: (..., BINS) histogram.
            log_variance: (...) logarithm of R.
        """
        level = (log_variance / 2)[..., None]
        of_shape, of_level, of_square = self.likelihood
        likelihood = counts @ of_shape + level * (counts @ of_level) + level * level * (counts @ of_square)
        prior, bias, width = self.laws(log_variance[..., None] / 3).split(LAWS, dim=-1)
        weights = torch.softmax(likelihood + prior, dim=-1)
        mean = (weights * bias).sum(dim=-1)
        within = torch.exp(2 * width.clamp(-3, 1)) * 0.1
        variance = (weights * ((bias - mean[..., None]) ** 2 + within)).sum(dim=-1)
        return weights, mean, variance + 1e-4


def _arsinh(values: Tensor) -> Tensor:
    """Return arsinh of values by its logarithm: ONNX Runtime has none of double precision."""
    size = values.abs()
    return torch.sign(values) * torch.log(size + torch.sqrt(size * size + 1))
