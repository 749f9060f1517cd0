"""Interface of controllers: a reference and a measurement in, the pull to command out, sample by sample."""

import abc
import math
from typing import TYPE_CHECKING, NamedTuple

from twin.control.anticipation import NOTHING_COMES, Array
from twin.control.limits import CommandLimits

if TYPE_CHECKING:
    from twin.control.plant import Plant


class Sensed(NamedTuple):
    """Input of a controller at one sample.

    Attributes:
        time_s: of the sample [s].
        measurement_deg: measured angle, NaN where there is none [deg].
        reference_deg: wanted angle now [deg].
        next_deg: wanted angle at the next sample [deg].
        coming_deg: (H,) wanted angles from the next sample on, as far ahead as they are known [deg].
    """

    time_s: float
    measurement_deg: float
    reference_deg: float
    next_deg: float
    coming_deg: Array = NOTHING_COMES


class Controller(abc.ABC):
    """A controller of one endoscope; made anew for each run.

    The pull that `step` returns is that of the end of the next sample. It is always a number within the
    limits, whatever a controller wants: it is bounded here, once for all of them.

    Attributes:
        limits: of the command.
        sample_time: T [s].
        pull_mm: latest command [mm].
        bend_deg: what it believes the angle to be; NaN where it does not ask [deg].
        falls_back: whether a simpler law is in charge, as the better one is not trusted now.
        holds: whether the command is held, as no measurement comes.
    """

    def __init__(self, limits: CommandLimits, sample_time: float) -> None:
        self.limits = limits
        self.sample_time = sample_time
        self.pull_mm = math.nan
        self.bend_deg = math.nan
        self.falls_back = self.holds = False

    def tell(self, plant: "Plant") -> None:  # noqa: B027  none but an oracle listens
        """Tell an oracle the endoscope itself, before the run begins; no other controller is told."""

    def start(self, pull_mm: float, reference_deg: float) -> None:
        """Begin a run on an endoscope that rests at a pull [mm] near a first reference [deg]."""
        self.pull_mm = pull_mm
        self._start(reference_deg)

    def step(self, sensed: Sensed) -> float:
        """Take in a sample and return the pull to command at the next one [mm]."""
        self.pull_mm = self.limits.within(self._wanted_mm(sensed), self.pull_mm, self.sample_time)
        self._commanded()
        return self.pull_mm

    def _start(self, reference_deg: float) -> None:  # noqa: B027  most have nothing to prepare
        """Prepare what moves, at the first reference [deg]."""

    @abc.abstractmethod
    def _wanted_mm(self, sensed: Sensed) -> float:
        """Return the pull that is wanted at the next sample [mm]; NaN keeps the latest."""

    def _commanded(self) -> None:  # noqa: B027  most need no note
        """Take note of `pull_mm`, which was bounded."""
