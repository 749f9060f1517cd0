"""A sample of a stream with what the runtime says of it, and the interface of all that takes samples in."""

import math
from typing import NamedTuple, Protocol

from twin.runtime.reading import Reading


class StreamSample(NamedTuple):
    """One sample and its reading.

    Attributes:
        time_s: time stamp as it came [s].
        pull_mm: commanded pulling distance, NaN where there was none [mm].
        measurement_deg: measured angle, NaN where there was none [deg].
        reading: what the runtime says of it.
        reference_deg: angle that is wanted at the next sample, NaN where none is told [deg].
    """

    time_s: float
    pull_mm: float
    measurement_deg: float
    reading: Reading
    reference_deg: float = math.nan


class Sink(Protocol):
    """Taker of samples: a recording, a viewer."""

    def add(self, sample: StreamSample, /) -> None:
        """Take in one sample; it must not wait for anybody.

        Raises:
            OSError: it cannot be written.
        """

    def close(self) -> None:
        """Complete what was made of the samples."""
