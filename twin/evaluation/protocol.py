"""Protocol of a comparison: the noises of each suite, the draws, and the wrong initial estimate."""

import dataclasses
import math

from twin.errors import InputError

Condition = tuple[str, float]
"""Kind and level of a measurement noise."""
RECORDED = "recorded"
"""Noise that a recorded measurement has, whatever its law."""
STEADY_SECONDS = 5.0
"""Left out of `rmse_steady_deg` [s]: the time in which the paper's AM loses the initial error."""

PAPER_CONDITIONS = (
    ("gaussian", 1.0),
    ("gaussian", 5.0),
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
)
SUITES = {
    "paper": PAPER_CONDITIONS + DITHERED_CONDITIONS,
    "paper-only": PAPER_CONDITIONS,
    "full": PAPER_CONDITIONS + UNSEEN_CONDITIONS,
}


@dataclasses.dataclass(frozen=True)
class Protocol:
    """Conditions under which methods are compared; the defaults are the paper's, where it says.

    Attributes:
        suite: one of `SUITES`, which says the noises.
        seeds: draws of each noise.
        sample_time_s: T [s].
        initial_error_deg: how far the initial estimate is off [deg].
        seed: of the draws.
        recorded_variance: R of recorded measurements, where they are used instead of drawn noise [deg^2].
    """

    suite: str = "paper"
    seeds: int = 20
    sample_time_s: float = 0.1
    initial_error_deg: float = 20.0
    seed: int = 0
    recorded_variance: float | None = None

    def __post_init__(self) -> None:
        """Refuse a protocol that cannot run.

        Raises:
            ValueError: the suite is unknown or a number is out of range.
        """
        if self.suite not in SUITES:
            raise InputError(f"unknown suite {self.suite!r}; valid: {', '.join(SUITES)}")
        if self.seeds < 1:
            raise InputError(f"seeds = {self.seeds}: must be at least 1")
        if not math.isfinite(self.initial_error_deg):
            raise InputError(f"initial_error_deg = {self.initial_error_deg}: must be a finite number")
        if not 0 < self.sample_time_s < math.inf:
            raise InputError(f"sample time {self.sample_time_s} s: must be positive and finite")
        if self.recorded_variance is not None:
            if not 0 < self.recorded_variance < math.inf:
                raise InputError(f"recorded_variance = {self.recorded_variance}: must be positive and finite")
            if self.seeds != 1:
                raise InputError(f"seeds = {self.seeds}: recorded measurements are one draw")

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Kinds and levels of the noises; of recorded measurements, their variance."""
        if self.recorded_variance is not None:
            return ((RECORDED, self.recorded_variance),)
        return SUITES[self.suite]
