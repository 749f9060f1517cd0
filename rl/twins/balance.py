"""Balance of errors: each family of noise counts as much as any other, each second as much as in its RMSE.

What is published is the geometric mean over noises of an RMSE over whole records. The logarithm of it has the
gradient of sum(e^2) / total for each family, where the total is over the record and all sequences of the
family. A training in windows does not know it: it is kept as a running mean, by family, sample time and place
of the window. The mean logarithm of each window's error, in its place, would count the first seconds as
little as any others, and a sequence whose noise is taken for another's no more than its neighbour.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from rl.twins.sequences import STRIDES, Sequences
from rl.twins.settings import SimulatedTraining

POWER = 0.7  # errors squared grow with R to about this power: one R counts as much as another
RECORD_S = 60.0  # the last window stands for all that follows in a record of this length,
MOST_LAST = 12  # but for no more windows than this
SMALLEST_ERROR_DEG2 = 1e-3  # added to square errors: their logarithm stays finite
_SLOWEST = 0.05  # weight of a new mean among those before


class TypicalErrors:
    """Running means of errors squared over R^0.7, by family, sample time and window.

    Attributes:
        means: (families, sample times, windows), zero where none has been met.
        met: how often each has been met.
    """

    def __init__(self, settings: SimulatedTraining):
        shape = (len(settings.noises), len(STRIDES), settings.windows)
        self.window = settings.window
        self.means: NDArray[np.float64] = np.zeros(shape)
        self.met: NDArray[np.float64] = np.zeros(shape)

    def loss(self, square_deg2: torch.Tensor, window: Sequences, place: int) -> torch.Tensor:
        """Return the balanced loss of one window, and meet it; arguments as in `meet`."""
        self.meet(square_deg2.detach(), window, place)
        return (self.factors(window, place) * square_deg2).mean()

    def meet(self, square_deg2: torch.Tensor, window: Sequences, place: int) -> None:
        """Learn what is typical.

        Args:
            square_deg2: (B,) mean square error of each sequence in the window [deg^2].
            window: its sequences.
            place: of the window in the episode.
        """
        scaled = square_deg2 / window.variance**POWER
        for family in torch.unique(window.family).tolist():
            where = family, STRIDES.index(window.stride), place
            square = float(scaled[window.family == family].mean())
            self.met[where] += 1
            self.means[where] += max(1 / self.met[where], _SLOWEST) * (square - self.means[where])

    def factors(self, window: Sequences, place: int) -> torch.Tensor:
        """Return (B,) what the square errors [deg^2] of sequences count by.

        A family that has not been met at this sample time counts as those that have.
        """
        stride = STRIDES.index(window.stride)
        weights = self._weights(float(window.sample_time[0]))
        factors = torch.zeros_like(window.variance)
        all_met = self.means[:, stride][self.met[:, stride] > 0]
        usual = float(all_met.mean()) if len(all_met) else 1.0
        for family in torch.unique(window.family).tolist():
            means, met = self.means[family, stride], self.met[family, stride] > 0
            total = weights @ np.where(met, means, means[met].mean() if met.any() else usual)
            factors[window.family == family] = len(weights) * weights[place] / total
        return factors / window.variance**POWER

    def _weights(self, sample_time: float) -> NDArray[np.float64]:
        """Return how many windows of a record each window of an episode stands for."""
        weights = np.ones(self.means.shape[2])
        rest = RECORD_S / (self.window * sample_time) - len(weights) + 1
        weights[-1] = min(max(rest, 1.0), MOST_LAST)
        return weights


def departure(action: torch.Tensor, linear: torch.Tensor) -> torch.Tensor:
    """Return (B,) how far a policy departs from the linear update where that is best.

    Args:
        action: (B, actions) of it, before they are bounded: on the gain, on R, and others that are free.
        linear: (B,) 1 where the linear update is the best there is or near it, else 0.
    """
    return linear * (torch.tanh(action[:, :2]) ** 2).sum(dim=1)
