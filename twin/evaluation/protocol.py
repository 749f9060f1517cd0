"""Protocol of a comparison: the noises of each suite, the draws, and the wrong initial estimate."""

import dataclasses

from twin.errors import InputError
from twin.files.bounds import (
    LARGEST_ERROR_DEG,
    LARGEST_VARIANCE_DEG2,
    MOST_SEEDS,
    SAMPLE_TIMES,
    check_between,
)
from twin.preset.preset import ZERO_DEVIATION_DEG
from twin.preset.sensor import LIMITS as SENSOR_LIMITS

Condition = tuple[str, float]  # kind and level of a measurement noise
RECORDED = "recorded"  # noise of a recorded measurement, of unknown distribution
RECORD_SAMPLE_TIME = 0.02  # of simulated test records [s]; coarser sampling thins them
STEADY_SECONDS = 5.0
"""Left out of `rmse_steady_deg` [s]: the time in which the paper's AM loses the initial error."""

GAUSSIAN_CONDITIONS = (("gaussian", 1.0), ("gaussian", 5.0))
PAPER_CONDITIONS = (
    *GAUSSIAN_CONDITIONS,
    ("poisson", 0.1),
    ("poisson", 1.0),
    ("poisson", 2.0),
)
DITHERED_CONDITIONS = (("poisson-dithered", 0.1), ("poisson-dithered", 1.0), ("poisson-dithered", 2.0))
UNSEEN_CONDITIONS = (
    ("laplace", 1.0),
    ("student-t", 1.0),
    ("uniform", 1.0),
    ("salt-and-pepper", 0.05),
    ("gamma", 1.0),
    ("stereo-vision", 4.0),
)
UNTRAINED_CONDITIONS = (
    ("gaussian", 1.0),
    ("drifting-bias", 2.0),
    ("correlated", 0.5),
    ("mixture", 1.0),
    ("quantised", 2.0),
    ("drop-outs", 0.3),
    ("delayed", 0.2),
    ("stuck", 0.1),
)
"""Faults of a sensor (`twin.signals.sensor_errors`); the first is none, for twins that are in no training."""
ALL_CONDITIONS = "all conditions"  # of a sealed suite, in its tables
SEALED = "sealed"
"""Suite, and noise of its rows, whose level is the number of conditions (`twin.evaluation.sealed`)."""
# Counts are whole degrees: without dither the angle could be read off their lattice.
SUITES = {
    "paper": PAPER_CONDITIONS + DITHERED_CONDITIONS,
    "paper-only": PAPER_CONDITIONS,
    "full": GAUSSIAN_CONDITIONS + DITHERED_CONDITIONS + UNSEEN_CONDITIONS,
    "untrained": UNTRAINED_CONDITIONS,
}


@dataclasses.dataclass(frozen=True)
class Protocol:
    """Conditions under which methods are compared; the defaults are the paper's, as far as it states them."""

    suite: str = "paper"  # one of `SUITES`: the noises
    seeds: int = 20  # draws of each noise
    sample_time_s: float = 0.1  # T [s]
    initial_error_deg: float = 20.0  # error of the initial estimate [deg]
    seed: int = 0  # of the draws
    recorded_variance: float | None = None  # R of recorded measurements, used instead of drawn noise [deg^2]
    sensor_zero_deviation_deg: float = ZERO_DEVIATION_DEG  # of what is known of the mean of their errors

    def __post_init__(self) -> None:
        if self.suite not in SUITES:
            valid = f"{', '.join(SUITES)}; `endotwin evaluate` has {SEALED} too"
            raise InputError(f"unknown suite {self.suite!r}; valid: {valid}")
        check_between("seeds", self.seeds, 1, MOST_SEEDS)
        check_between("initial_error_deg", self.initial_error_deg, -LARGEST_ERROR_DEG, LARGEST_ERROR_DEG)
        check_between("sample_time", self.sample_time_s, *SAMPLE_TIMES, "s")
        check_between(
            "sensor_zero_deviation_deg",
            self.sensor_zero_deviation_deg,
            *SENSOR_LIMITS["zero_deviation_deg"],
            "deg",
        )
        if self.recorded_variance is not None:
            if not 0 < self.recorded_variance <= LARGEST_VARIANCE_DEG2:
                raise InputError(
                    f"recorded_variance = {self.recorded_variance:g}: must be positive, at most "
                    f"{LARGEST_VARIANCE_DEG2:g}"
                )
            if self.seeds != 1:
                raise InputError(f"seeds = {self.seeds}: recorded measurements are one draw")

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Kinds and levels of the noises; of recorded measurements, their variance."""
        if self.recorded_variance is not None:
            return ((RECORDED, self.recorded_variance),)
        return SUITES[self.suite]
