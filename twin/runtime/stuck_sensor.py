"""Detector of a sensor that says the very same number again and again, though it never does so at rest."""

import math

REPEATS = 2  # of one number, which a sensor with noise never does
USUAL = 0.06  # share of numbers that are repeated, from which a sensor is one that repeats numbers
LEARN = 0.02  # of that share, by one number: a sensor that is stuck now and then is not quantised
LEARN_LENGTH = 0.1  # of the length of runs
LONGEST_RUN = 100
LEAST = 1e-9  # probability below which a run of equal numbers is no chance, where runs are usual


class StuckSensor:
    """Length of the present run of equal measurements, beside that of usual ones.

    A sensor with noise never repeats a number: two repeats are enough. One that is quantised does, and what
    counts as long is learned from the runs that have ended.
    """

    def __init__(self) -> None:
        self._last = math.nan
        self._repeats = 0
        self._repeated = 0.0  # share of numbers that were repeated
        self._length = 1.0  # usual length of a run of those
        self._longest = REPEATS

    def is_stuck(self, measurement_deg: float) -> bool:
        """Take in a measurement, NaN where there is none; returns whether its run is too long for chance."""
        if measurement_deg != measurement_deg:
            return False
        if measurement_deg == self._last:
            self._repeats += 1
            return self._repeats >= self._longest
        self._last = measurement_deg
        if self._repeats or self._repeated:
            self._learn()
        return False

    def _learn(self) -> None:
        """Take in the run that has ended."""
        self._repeated += LEARN * ((self._repeats > 0) - self._repeated)
        if self._repeats:
            self._length += LEARN_LENGTH * (min(self._repeats + 1, LONGEST_RUN) - self._length)
        self._repeats = 0
        self._longest = REPEATS
        if self._repeated > USUAL:  # lengths are geometric: chance goes on with 1 - 1 / length
            goes_on = 1 - 1 / max(self._length, 1.1)
            self._longest = max(REPEATS, math.ceil(math.log(LEAST) / math.log(goes_on)))
