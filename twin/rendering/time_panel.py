"""Animated course of the bend: bending angle over time, beside the angle that was wanted."""

from twin.episode import Episode
from twin.rendering.beside import Beside, curves_of
from twin.rendering.trace_panel import INK, Curve, TracePanel

X_LABEL = "time [s]"


class TimePanel(TracePanel):
    """Plot of bending angle over time: the reference, and the whole bend pale behind its trace."""

    def __init__(self, episode: Episode, width: int, height: int, beside: Beside) -> None:
        """Draw the static parts.

        Args:
            episode: the record.
            width: of the panel [pixels].
            height: of the panel [pixels].
            beside: the reference, and the ghost if there is one.
        """
        still = time_curves(episode, beside, moving=True)
        super().__init__(episode.time, episode.bend_deg, X_LABEL, still, width, height)


def time_curves(episode: Episode, beside: Beside, *, moving: bool) -> list[Curve]:
    """Return the bend of an episode and of its ghost over time, as `curves_of` does, and the reference."""
    reference = Curve(episode.time, beside.reference_deg, INK, dashed=True, name="reference", width=1.3)
    return [*curves_of("time", episode, beside, moving=moving), reference]
