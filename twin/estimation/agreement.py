"""Agreement of refused samples: a run of them that agree among themselves is a change, not a fault.

A live stream refuses what is far from what it knows. Were that all, one real jump would lock it out for ever.
"""

import collections
import math
import statistics
from typing import NamedTuple


class Refused(NamedTuple):
    """Sample that was refused, for its pull or for its measurement.

    Attributes:
        pull_mm: pull that the estimator would have been given [mm].
        measurement_deg: NaN where there is none [deg].
    """

    pull_mm: float
    measurement_deg: float


class AgreeingRun:
    """Samples that were refused one after the other and agree; a run that is long enough is believed.

    Attributes:
        begun: whether there is a sample in it.
    """

    def __init__(self, enough: int):
        """Prepare for runs of so many samples."""
        self._samples: collections.deque[Refused] = collections.deque(maxlen=enough)
        self._last = math.nan
        self.begun = False

    def believes(self, value: float, tolerance: float, sample: Refused) -> bool:
        """Take in a refused sample and return whether the run is long enough to be believed.

        Args:
            value: that the sample was refused for.
            tolerance: distance from the value before up to which both agree.
            sample: pull and measurement.
        """
        if self._samples and abs(value - self._last) > tolerance:
            self._samples.clear()
        self._last = value
        self._samples.append(sample)
        self.begun = True
        return len(self._samples) == self._samples.maxlen

    def clear(self) -> None:
        """Forget the run."""
        self._samples.clear()
        self.begun = False

    def restart(self) -> tuple[Refused, list[Refused]] | None:
        """Return where an estimator begins anew, and the samples behind that it has still to step to.

        It begins in the middle of the run, at the median of its measurements: a single one would hand its
        noise to filters that trust their first angle. None where nothing was measured.
        """
        samples = list(self._samples)
        measured = [sample.measurement_deg for sample in samples if math.isfinite(sample.measurement_deg)]
        if not measured:
            return None
        middle = len(samples) // 2
        return Refused(samples[middle].pull_mm, statistics.median(measured)), samples[middle + 1 :]
