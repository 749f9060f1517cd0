"""Health of a live stream: what was wrong with a sample, and the limits beyond which it is wrong."""

import dataclasses
import enum
import math

from twin.errors import InputError
from twin.signals.plausible import LARGEST_BEND_DEG, LARGEST_PULL_MM, LARGEST_TIME_S


class Health(enum.Flag):
    """Faults of one sample of a live stream, any number of them together; `Health.GOOD` is none.

    Attributes:
        GOOD: nothing was wrong.
        NO_TIME: the time stamp is not finite or beyond all dates: the sample is ignored.
        LATE: it is not later than the one before: the sample is ignored.
        CLOCK_JUMP: it is farther ahead than a pause may be long: the sample is ignored.
        CLOCK_RESET: after samples on another clock that agree, the stream goes on by that clock from here.
        GAP: samples are missing before this one; predictions took their place.
        NO_PULL: the pull is not finite: the last one is held.
        IMPLAUSIBLE_PULL: the pull is beyond its limit, or too far from the last one: the last one is held.
        NO_MEASUREMENT: the measurement is not finite: it is missing.
        IMPLAUSIBLE_MEASUREMENT: it is beyond its limit: it is taken as missing.
        OUTLIER: it is too far from the last estimate: it is taken as missing.
        REFUSED: a step led to a state that is not sound, and was not taken.
        RESTARTED: the estimator began anew at this sample.
        WAITING: no pull has come yet: the stream has not begun.
    """

    GOOD = 0
    NO_TIME = enum.auto()
    LATE = enum.auto()
    CLOCK_JUMP = enum.auto()
    CLOCK_RESET = enum.auto()
    GAP = enum.auto()
    NO_PULL = enum.auto()
    IMPLAUSIBLE_PULL = enum.auto()
    NO_MEASUREMENT = enum.auto()
    IMPLAUSIBLE_MEASUREMENT = enum.auto()
    OUTLIER = enum.auto()
    REFUSED = enum.auto()
    RESTARTED = enum.auto()
    WAITING = enum.auto()


@dataclasses.dataclass(frozen=True)
class StreamLimits:
    """Limits of what a live stream takes at its word; wide enough that a healthy stream never meets them.

    Attributes:
        bend_deg: magnitude of a measurement [deg].
        pull_mm: magnitude of a pull [mm].
        time_s: magnitude of a time stamp [s].
        pause_s: longest pause of a stream; a stamp farther ahead is of another clock [s].
        pull_jump_mm: move of the pull between two samples, whatever the time between them [mm].
        pull_speed_mm_s: speed of the pull beyond that; our commands stay below 10 mm/s [mm / s].
        outlier_deg: distance from the last estimate that is never too far [deg].
        outlier_factor: how much farther, relative to the usual distance of late.
        outlier_most_deg: distance that is always too far; an estimate that begins 20 deg off is not [deg].
        agreement_s: time for which refused values must agree before they are believed [s].
    """

    bend_deg: float = LARGEST_BEND_DEG
    pull_mm: float = LARGEST_PULL_MM
    time_s: float = LARGEST_TIME_S
    pause_s: float = 86_400.0
    pull_jump_mm: float = 0.5
    pull_speed_mm_s: float = 12.0
    outlier_deg: float = 10.0
    outlier_factor: float = 3.0
    outlier_most_deg: float = 90.0
    agreement_s: float = 0.5

    def __post_init__(self) -> None:
        """Refuse a limit that is none.

        Raises:
            ValueError: a limit is negative or no number.
        """
        for name, limit in vars(self).items():
            if not 0 <= limit <= math.inf:
                raise InputError(f"{name} = {limit}: must be a number that is not negative")
