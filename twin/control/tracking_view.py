"""View of a trained tracking policy: what it observes of the loop, and the command that its action asks for.

The environment that it is trained in and the controller that runs it share this file.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.control.limits import CommandLimits
from twin.control.line import Line

Observation = NDArray[np.float32]

ERROR_DEG, RATE_DEG_S, OFFSET_MM = 5.0, 10.0, 0.5
"""Error [deg], rate of the reference [deg / s] and offset [mm] that are 1 in an observation."""
SMOOTHING_S = 0.2
"""Time constant of the low-passed error [s]: it averages noise over tens of samples."""
OBSERVED = 6
"""Numbers of an observation."""
OBSERVATION_LIMIT = 10.0
"""Largest number of an observation; never reached on a sound endoscope, it only bounds the space."""


@dataclasses.dataclass(frozen=True)
class TrackingView:
    """Scales of observation and action, of the nominal endoscope on one stroke.

    An observation is six numbers, of about unit size:

    0. measured angle less reference [`ERROR_DEG`];
    1. the same, low-passed with `SMOOTHING_S`;
    2. reference, from the middle of what the nominal endoscope reaches [half of that];
    3. rate of the reference towards the next sample [`RATE_DEG_S`];
    4. offset: command less the line's pull for the reference [`OFFSET_MM`];
    5. latest change of the command [speed limit times T].

    Attributes:
        line: of the nominal endoscope on the stroke.
        limits: of the command.
        sample_time: T [s].
    """

    line: Line
    limits: CommandLimits
    sample_time: float

    @property
    def way_mm(self) -> float:
        """Farthest way of the command in one sample [mm]."""
        return self.limits.speed_mm_s * self.sample_time

    def smoothed(self, smooth_deg: float, error_deg: float) -> float:
        """Return the low-passed error one sample after `smooth_deg`, with a measured error [deg]."""
        share = 1 - np.exp(-self.sample_time / SMOOTHING_S)
        return smooth_deg + float(share) * (error_deg - smooth_deg)

    def observation(
        self,
        error_deg: float,
        smooth_deg: float,
        reference_deg: float,
        next_deg: float,
        pull_mm: float,
        change_mm: float,
    ) -> Observation:
        """Return what a policy sees at a sample, (6,).

        Args:
            error_deg: measured angle less reference [deg].
            smooth_deg: the same, low-passed [deg].
            reference_deg: wanted angle now [deg].
            next_deg: wanted angle at the next sample [deg].
            pull_mm: command that stands [mm].
            change_mm: its latest change [mm].
        """
        low, high = self.line.reached_deg
        seen = [
            error_deg / ERROR_DEG,
            smooth_deg / ERROR_DEG,
            (reference_deg - (low + high) / 2) / ((high - low) / 2),
            (next_deg - reference_deg) / self.sample_time / RATE_DEG_S,
            self._offset_mm(pull_mm, reference_deg) / OFFSET_MM,
            change_mm / self.way_mm,
        ]
        return np.clip(seen, -OBSERVATION_LIMIT, OBSERVATION_LIMIT).astype(np.float32)

    def wanted_mm(self, action: float, pull_mm: float, reference_deg: float, next_deg: float) -> float:
        """Return the pull that an action asks for at the next sample, not bounded yet [mm].

        Args:
            action: change of the offset, within [-1, 1] or clipped to it [speed limit times T].
            pull_mm: command that stands [mm].
            reference_deg: wanted angle now [deg].
            next_deg: wanted angle at the next sample [deg].
        """
        share = min(max(action, -1.0), 1.0)
        # The offset follows from the command, so that it does not wind up at a limit.
        return self.line.pull_mm(next_deg) + self._offset_mm(pull_mm, reference_deg) + share * self.way_mm

    def _offset_mm(self, pull_mm: float, reference_deg: float) -> float:
        return pull_mm - self.line.pull_mm(reference_deg)
