"""Messages of what an estimator makes of an episode or a live stream: its estimates, and its health."""

import math
import re
from typing import TYPE_CHECKING, Any

from twin.recording.endotwin_pb2 import Estimate
from twin.recording.endotwin_pb2 import Health as HealthMessage

if TYPE_CHECKING:
    from twin.live.reading import Reading

HEALTH_TOPIC = "/health"
"""Topic of what a running estimator found wrong with a sample."""


REFERENCE_TOPIC = "/reference"
"""Topic of the angles that a controller was to follow, as messages of `Estimate`."""


def estimate_topic(method: str) -> str:
    """Return the topic of a method's estimates: `/estimate/` and its name, in letters, digits, - and _."""
    return "/estimate/" + re.sub(r"[^A-Za-z0-9-]+", "_", method).strip("_")


def estimate_message(estimate_deg: float, low_deg: float = math.nan, high_deg: float = math.nan) -> Any:
    """Return a message of one estimate; an end of its 95 % interval is left out unless it is finite."""
    message = Estimate(estimate_deg=estimate_deg)
    if math.isfinite(low_deg):
        message.low_deg = low_deg
    if math.isfinite(high_deg):
        message.high_deg = high_deg
    return message


def health_message(reading: "Reading") -> Any:
    """Return a message of what was wrong with one sample: faults and alarms by name, and the source."""
    return HealthMessage(
        faults=[str(fault.name).lower() for fault in reading.health],
        alarms=[str(alarm.name).lower() for alarm in reading.alarms],
        source=reading.source.value,
    )
