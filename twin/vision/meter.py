"""Interface of what reads a bending angle out of a pair of pictures."""

from typing import Protocol

from twin.vision.bench import Pair


class Meter(Protocol):
    """Meter of the bending angle; it knows the cameras' calibration, and not where anything really is."""

    def zero(self, pairs: list[Pair]) -> int:
        """Take the endoscope for straight in pairs of pictures; returns in how many it is seen."""

    def forget(self) -> None:
        """Forget the last picture: another record begins."""

    def angle(self, pair: Pair) -> float:
        """Return the bending angle in the plane of wires a and b [rad]; NaN where it is not known."""
