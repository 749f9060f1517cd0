"""Reading of the runtime at one sample: an estimate, its interval, its source, faults and alarms."""

import enum
from typing import NamedTuple

from twin.estimation.health import Health

UNKNOWN_DEG = 180.0  # half of an interval of which nothing is known
ROUNDING_DEG = 1e-6


class Source(enum.Enum):
    """Source of an estimate.

    Attributes:
        ADVANCED: the trained estimator.
        FALLBACK: the trusted filter.
        BLEND: a mean of both, on the way from one to the other.
    """

    ADVANCED = "advanced"
    FALLBACK = "fallback"
    BLEND = "blend"


class Alarm(enum.Flag):
    """Alarms of one sample, any number of them together; `Alarm.NONE` is none.

    Those from INNOVATION to LOST speak against the trained estimator: three samples with any of them take the
    fallback, a single one where it began anew. The others speak of the sample.

    Attributes:
        NONE: nothing speaks against it.
        INNOVATION: over 2.5 s it foretells measurements worse than the fallback, or is off by a constant.
        DISAGREEMENT: it is farther from the fallback than both say that they may be wrong.
        RANGE: its estimate is far beyond the angles that it was trained on.
        RATE: its estimate moves by more than the endoscope and the noise can.
        COMMAND: the command is beyond the distances or the speed that it was trained on.
        INTERVAL: its interval is no number, or wider than 90 deg to each side.
        LOST: it began anew where the fallback had no need to, or a step of its led to no sound state.
        STUCK: the sensor has said the very same number for too long, and counts as silent.
        TIMEOUT: no measurement has come for too long.
        INPUT: this sample was faulty (`Reading.health`), or its measurement is far from what both foretell.
        BEGINNING: too few samples have come to judge.
    """

    NONE = 0
    INNOVATION = enum.auto()
    DISAGREEMENT = enum.auto()
    RANGE = enum.auto()
    RATE = enum.auto()
    COMMAND = enum.auto()
    INTERVAL = enum.auto()
    LOST = enum.auto()
    STUCK = enum.auto()
    TIMEOUT = enum.auto()
    INPUT = enum.auto()
    BEGINNING = enum.auto()


class Reading(NamedTuple):
    """Estimate at one sample, with all that is known of it.

    Attributes:
        bend_deg: estimate; never NaN [deg].
        low_deg: lower end of its 95 % interval; 180 deg below the estimate where it is not known [deg].
        high_deg: upper end of it; 180 deg above where it is not known [deg].
        source: who made it.
        health: faults of the sample.
        alarms: why the trained estimator is not trusted, or what spoke against it in this sample.
    """

    bend_deg: float
    low_deg: float
    high_deg: float
    source: Source
    health: Health
    alarms: Alarm

    @property
    def interval_deg(self) -> tuple[float, float] | None:
        """95 % interval, low and high [deg]; None where it is not known."""
        known = abs(self.high_deg - self.low_deg) < 2 * UNKNOWN_DEG - ROUNDING_DEG
        return (self.low_deg, self.high_deg) if known else None
