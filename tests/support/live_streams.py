"""Samples of a live stream, what a record of them should hold, and a process that records without end.

`python live_streams.py FILE` records the wall clock into FILE until it is killed.
"""

import math
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from twin.live.reading import Alarm, Health, Reading, Source, StreamSample
from twin.recording.live import LiveRecording

METHOD = "RAM (twins)"
ESTIMATE = "/estimate/RAM_twins"
PERIOD_S = 0.005


Sample = StreamSample


def reading(
    bend_deg: float = 12.5, health: Health = Health.GOOD, alarms: Alarm = Alarm.NONE, width_deg: float = 2.0
) -> Reading:
    low, high = bend_deg - width_deg, bend_deg + width_deg
    return Reading(bend_deg, low, high, Source.ADVANCED, health, alarms)


def sample(
    time_s: Any, pull_mm: Any = 1.0, measurement_deg: Any = 2.0, health: Health = Health.GOOD
) -> Sample:
    return Sample(time_s, pull_mm, measurement_deg, reading(health=health))


def good_samples(count: int, step_s: float = 0.02, start_s: float = 0.0) -> list[Sample]:
    """A stream without faults that uses every digit of a double; each fourth has no measurement."""
    return [
        Sample(
            start_s + k * step_s,
            3 + math.sin(k / 50),
            math.nan if k % 4 == 3 else 40 * math.sin(k / 50 - 0.3),
            reading(40 * math.sin(k / 50), width_deg=2 + math.cos(k)),
        )
        for k in range(count)
    ]


def record(path: Path, samples: Iterable[Sample], **options: Any) -> LiveRecording:
    with LiveRecording(path, METHOD, **options) as recording:
        for one in samples:
            recording.add(one)
    return recording


def record_the_wall_clock(path: Path) -> None:
    """Record samples whose time stamps say when they were added, and whose pulls count them."""
    with LiveRecording(path, METHOD) as recording:
        for number in range(10**9):
            recording.add(sample(time.time(), number * 1e-6, number * 1e-6))
            time.sleep(PERIOD_S)


if __name__ == "__main__":
    record_the_wall_clock(Path(sys.argv[1]))
