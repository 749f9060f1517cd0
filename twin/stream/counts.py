"""Counts of a run: samples by who made their estimate, faults and alarms by name."""

import collections
from typing import Any

from twin.runtime.reading import Source
from twin.stream.protocol import flag_names
from twin.stream.sample import StreamSample


class RunCounts:
    """Counts of the samples of a run; a sink as any other.

    Attributes:
        samples: number of samples.
        faulty: samples with any fault.
        sources: samples by who made the estimate.
        faults: samples by fault.
        alarms: samples by alarm.
    """

    def __init__(self) -> None:
        """Begin at none."""
        self.samples = self.faulty = 0
        self.sources: collections.Counter[Source] = collections.Counter()
        self.faults: collections.Counter[str] = collections.Counter()
        self.alarms: collections.Counter[str] = collections.Counter()

    def add(self, sample: StreamSample) -> None:
        """Count one sample."""
        reading = sample.reading
        self.samples += 1
        self.sources[reading.source] += 1
        if reading.health:
            self.faulty += 1
            self.faults.update(flag_names(reading.health))
        if reading.alarms:
            self.alarms.update(flag_names(reading.alarms))

    def close(self) -> None:
        """Do nothing: the counts stay."""

    def share(self, source: Source) -> float:
        """Return the share of the samples whose estimate somebody made; 0 without samples."""
        return self.sources[source] / max(self.samples, 1)

    def to_dict(self) -> dict[str, Any]:
        """Return the counts as plain values."""
        return {
            "samples": self.samples,
            "fallback_share": self.share(Source.FALLBACK),
            "blend_share": self.share(Source.BLEND),
            "faulty": self.faulty,
            "faults": dict(self.faults),
            "alarms": dict(self.alarms),
        }

    def __str__(self) -> str:
        """One line for a person."""
        text = f"{self.samples} samples, {self.share(Source.FALLBACK):.1%} by the fallback"
        if self.sources[Source.BLEND]:
            text += f", {self.share(Source.BLEND):.1%} blended"
        text += f", {self.faulty} with faults"
        if self.faults:
            text += f" ({', '.join(f'{name} {count}' for name, count in self.faults.most_common())})"
        return text
