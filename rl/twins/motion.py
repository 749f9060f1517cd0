"""Motion of what is estimated, from one sample to the next, while the tendon goes.

The angle is mean of the members + c . a + d, where a are the anomalies of the members along r fixed
directions, c their coefficients (Evensen 2003) and d what no member does. c drifts with the way of the
tendon, and d decays with it.
"""

import torch

Tensor = torch.Tensor

MEMORY_MM = 5.0  # way of the tendon after which d is forgotten
GROWTH_DEG2_PER_MM, GROWTH_DEG2_PER_S = 0.05, 0.0065  # of the variance of d, times what the policy says
MEMBERS_PER_MM = 5e-4  # growth of the variance of the coefficients: what keeps them awake for hours
FIRST_ERROR_DEG2 = 0.02  # variance of d before anything is measured
NO_ERROR = 1e-6  # share of the variances of d where there is to be none; zero would mark a first sample


class MemberMotion(torch.nn.Module):
    """Decay and growth of the r coefficients c and of d, in this order: n = r + 1 numbers."""

    def __init__(self, rank: int, *, with_error: bool = True):
        super().__init__()
        # Parts of the state are picked by constant vectors: the exported graph needs no slices then.
        units = torch.eye(rank + 1)
        self.unit = torch.nn.Buffer(units)
        self.of_error = torch.nn.Buffer(units[rank])
        self.of_members = torch.nn.Buffer(units[:rank].sum(dim=0))
        self.share_of_error = torch.nn.Buffer(torch.tensor(1.0 if with_error else NO_ERROR))

    def first_covariance(self, variance: Tensor) -> Tensor:
        """Return (B, n, n) before anything is measured, for (B,) filters whatever their R."""
        first: Tensor = self.of_members + FIRST_ERROR_DEG2 * self.share_of_error * self.of_error
        # A product, as the exported graph has no operator that makes an array of the batch's size.
        return (1 + 0 * variance)[:, None, None] * first[:, None] * self.unit

    def keep(self, way_mm: Tensor) -> Tensor:
        """Return (B, n) what is left of each number after a way (B,) [mm]."""
        return 1 - (1 - torch.exp(-way_mm / MEMORY_MM))[:, None] * self.of_error

    def growth(self, way_mm: Tensor, sample_time: Tensor) -> tuple[Tensor, Tensor]:
        """Return what the variances grow by: (B, n) of d, and (B, n) of c."""
        of_error = (GROWTH_DEG2_PER_MM * way_mm + GROWTH_DEG2_PER_S * sample_time) * self.share_of_error
        return of_error[:, None] * self.of_error, MEMBERS_PER_MM * way_mm[:, None] * self.of_members
