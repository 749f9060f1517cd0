"""Statistics of a dataset that is seen once, record by record, and never held whole.

Means and squares are merged pairwise (Chan, Golub and LeVeque 1979, "Updating Formulae and a Pairwise
Algorithm for Computing Sample Variances"): nothing is lost where the mean is large beside the deviation.
Quantiles come from a histogram whose bins are as wide as a power of two and begin at its multiples, so that
two neighbours merge into one of twice the width without moving a count: it widens as values come, whatever
their order.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Those that LeRobot keeps, by its names for them."""
BINS = 8192
"""Of a histogram; a bin is less than two of this many parts of the range wide: 0.025 %."""
_FINEST = -1000  # exponent of the least width of a bin


def exact_statistics(values: Array) -> dict[str, list[float]]:
    """Return the statistics of one record.

    Args:
        values: (N, columns); what is NaN is not known and not counted.

    Returns:
        `min`, `max`, `mean`, `std` and the quantiles of each column, NaN where nothing is known, and `count`,
        one number: samples at which all columns are known.
    """
    columns = [column[~np.isnan(column)] for column in values.T]
    known = [column if len(column) else np.array([np.nan]) for column in columns]
    told: dict[str, list[float]] = {
        "min": [float(column.min()) for column in known],
        "max": [float(column.max()) for column in known],
        "mean": [float(column.mean()) for column in known],
        "std": [float(column.std()) for column in known],
        "count": [_whole(values)],
    }
    quantiles = np.array([np.quantile(column, list(QUANTILES.values())) for column in known]).T
    return told | dict(zip(QUANTILES, quantiles.tolist(), strict=True))


class RunningStatistics:
    """The same of all records seen so far; of these, only sums and histograms are kept."""

    def __init__(self, columns: int) -> None:
        """Begin with nothing seen."""
        self._whole = 0
        self._count = np.zeros(columns)
        self._mean = np.zeros(columns)
        self._squares = np.zeros(columns)  # sum of squared deviations from the mean
        self._histograms = [Histogram() for _ in range(columns)]

    def add(self, values: Array) -> None:
        """See another record: (N, columns), NaN where a value is not known."""
        known = ~np.isnan(values)
        count = known.sum(axis=0).astype(float)
        mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1)
        squares = (np.where(known, values - mean, 0.0) ** 2).sum(axis=0)
        share = count / np.maximum(self._count + count, 1)
        apart = mean - self._mean
        self._squares += squares + apart**2 * self._count * share
        self._mean += apart * share
        self._count += count
        self._whole += _whole(values)
        for histogram, column, seen in zip(self._histograms, values.T, known.T, strict=True):
            histogram.add(column[seen])

    def result(self) -> Mapping[str, list[float]]:
        """Return what `exact_statistics` returns; quantiles are off by the width of a bin at most."""
        counted = np.where(self._count > 0, self._count, np.nan)
        told: dict[str, list[float]] = {
            "min": [histogram.low for histogram in self._histograms],
            "max": [histogram.high for histogram in self._histograms],
            "mean": (self._mean + 0 * counted).tolist(),
            "std": np.sqrt(self._squares / counted).tolist(),
            "count": [self._whole],
        }
        quantiles = np.array(
            [histogram.quantiles(list(QUANTILES.values())) for histogram in self._histograms]
        ).T
        return told | dict(zip(QUANTILES, quantiles.tolist(), strict=True))


class Histogram:
    """Counts of numbers in at most `BINS` bins, which double in width when they no longer span the range."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self.low, self.high = np.nan, np.nan
        self._exponent = _FINEST  # a bin is 2 ** exponent wide
        self._first = 0  # of the bins, counted from the one that begins at zero
        self._counts = np.zeros(0, dtype=np.int64)

    def add(self, values: Array) -> None:
        """Count more numbers: (N,), finite; N may be 0."""
        if len(values) == 0:
            return
        self.low = float(np.fmin(self.low, values.min()))
        self.high = float(np.fmax(self.high, values.max()))
        old = np.arange(self._first, self._first + len(self._counts))
        exponent = self._fitting_exponent()
        # A shift by more than 63 is undefined; by 62 all that is left is the sign, as by more.
        old >>= min(exponent - self._exponent, 62)
        self._exponent = exponent
        self._first = self._bin(self.low, exponent)
        bins = self._bin(self.high, exponent) - self._first + 1
        new = np.floor(np.ldexp(values, -exponent)).astype(np.int64)
        counts = np.bincount(new - self._first, minlength=bins)
        np.add.at(counts, old - self._first, self._counts)
        self._counts = counts

    def quantiles(self, wanted: list[float]) -> Array:
        """Return quantiles, linear between the numbers as NumPy's are, each number known to within its bin.

        Args:
            wanted: from 0 to 1.

        Returns:
            One for each wanted; NaN where nothing was seen.
        """
        total = int(self._counts.sum())
        if total == 0:
            return np.full(len(wanted), np.nan)
        rank = np.array(wanted) * (total - 1)
        below, above = self._number(np.floor(rank)), self._number(np.ceil(rank))
        between: Array = below + (rank - np.floor(rank)) * (above - below)
        return between

    def _number(self, rank: Array) -> Array:
        """Return about the number of a rank from 0 on: those of a bin are taken to lie evenly in it."""
        until = np.cumsum(self._counts)
        place = np.searchsorted(until, rank, side="right")
        share = (rank - (until - self._counts)[place] + 0.5) / self._counts[place]
        return np.clip(np.ldexp(self._first + place + share, self._exponent), self.low, self.high)

    def _fitting_exponent(self) -> int:
        """Return the exponent of the narrowest bins that span the range and are no narrower than now."""
        span = np.frexp(self.high - self.low)[1] if self.high > self.low else _FINEST
        digits = np.frexp(max(abs(self.low), abs(self.high)))[1] - 52 if self.high or self.low else _FINEST
        exponent = max(int(span) - BINS.bit_length() + 1, int(digits), self._exponent)
        while self._bin(self.high, exponent) - self._bin(self.low, exponent) >= BINS:
            exponent += 1
        return exponent

    @staticmethod
    def _bin(value: float, exponent: int) -> int:
        return int(np.floor(np.ldexp(value, -exponent)))


def _whole(values: Array) -> int:
    return int((~np.isnan(values)).all(axis=1).sum())
