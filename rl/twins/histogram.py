"""Histogram of residuals in units of sqrt(R): what tells whether the noise is a strange one."""

import torch

Tensor = torch.Tensor

BINS = 56
LARGEST_RESIDUAL = 3.9  # of the histogram's scale asinh(4 r): 6 sqrt(R)


class ResidualHistogram(torch.nn.Module):
    """Bins of residuals, narrow about zero and wide where residuals are few."""

    def __init__(self) -> None:
        super().__init__()
        self.centres = torch.nn.Buffer(torch.linspace(-LARGEST_RESIDUAL, LARGEST_RESIDUAL, BINS))

    def forward(self, residual: Tensor, doubt: Tensor) -> Tensor:
        """Return (..., BINS) what residuals count in the histogram.

        A residual is shared by the two nearest bins; one of a prediction that is in doubt counts less.

        Args:
            residual: (...) in units of sqrt(R).
            doubt: (...) variance of the prediction in units of R.
        """
        place = _arsinh(4 * residual).clamp(-LARGEST_RESIDUAL, LARGEST_RESIDUAL)
        between = 2 * LARGEST_RESIDUAL / (BINS - 1)
        share = (1 - (place[..., None] - self.centres).abs() / between).clamp(min=0)
        return share / (1 + doubt)[..., None]


def _arsinh(values: Tensor) -> Tensor:
    """Return arsinh of values by its logarithm: ONNX Runtime has none of double precision."""
    size = values.abs()
    return torch.sign(values) * torch.log(size + torch.sqrt(size * size + 1))
