"""How methods are compared: the noises of each suite, the draws, and the wrong initial estimate."""

import dataclasses
import math

Condition = tuple[str, float]
"""Kind and level of a measurement noise."""
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
    """How methods are compared; the defaults are the paper's, where it says."""

    suite: str = "paper"
    seeds: int = 20
    """Draws of the noise."""
    sample_time_s: float = 0.1
    initial_error_deg: float = 20.0
    """How far the initial estimate is off."""
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a protocol that cannot run.

        Raises:
            ValueError: the suite is unknown or a number is out of range.
        """
        if self.suite not in SUITES:
            raise ValueError(f"unknown suite {self.suite!r}; valid: {', '.join(SUITES)}")
        if self.seeds < 1:
            raise ValueError(f"seeds = {self.seeds}: must be at least 1")
        if not math.isfinite(self.initial_error_deg):
            raise ValueError(f"initial_error_deg = {self.initial_error_deg}: must be a finite number")
        if not 0 < self.sample_time_s < math.inf:
            raise ValueError(f"sample time {self.sample_time_s} s: must be positive and finite")
