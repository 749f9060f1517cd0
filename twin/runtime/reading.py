"""Reading of the runtime at one sample: an estimate, its interval, its source, faults and alarms."""

import enum
from typing import NamedTuple

from twin.estimation.health import Health


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

    Those from INNOVATION to INTERVAL speak against the trained estimator: three samples with any of them take
    the fallback. The others speak of the sample.

    Attributes:
        NONE: nothing speaks against it.
        INNOVATION: over 2.5 s it foretells measurements worse than the fallback, or is off by a constant.
        DISAGREEMENT: it is farther from the fallback than both say that they may be wrong.
        RANGE: its estimate is far beyond the angles that it was trained on.
        RATE: its estimate moves by more than the endoscope and the noise can.
        COMMAND: the command is beyond the distances or the speed that it was trained on.
        INTERVAL: its interval is no number, or wider than 90 deg to each side.
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
    STUCK = enum.auto()
    TIMEOUT = enum.auto()
    INPUT = enum.auto()
    BEGINNING = enum.auto()


class Reading(NamedTuple):
    """Estimate at one sample, with all that is known of it.

    Attributes:
        bend_deg: estimate; never NaN [deg].
        low_deg: lower end of its 95 % interval [deg].
        high_deg: upper end of it [deg].
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
