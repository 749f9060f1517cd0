"""Animated hysteresis loop: bending angle over pulling distance."""

from twin.episode import Episode
from twin.rendering.beside import NOTHING, Beside, curves_of
from twin.rendering.trace_panel import Curve, TracePanel

X_LABEL = "pulling distance [mm]"


class LoopPanel(TracePanel):
    """Plot of bending angle over pulling distance: the whole loop stands pale behind its trace."""

    def __init__(self, episode: Episode, width: int, height: int, beside: Beside = NOTHING) -> None:
        """Draw the static parts.

        Args:
            episode: the record.
            width: of the panel [pixels].
            height: of the panel [pixels].
            beside: what is drawn with it; of its ghost, the loop.
        """
        still = loop_curves(episode, beside, moving=True)
        super().__init__(episode.pull_mm, episode.bend_deg, X_LABEL, still, width, height)


def loop_curves(episode: Episode, beside: Beside, *, moving: bool) -> list[Curve]:
    """Return the loop of an episode and of its ghost, as `curves_of` does."""
    return curves_of("pull_mm", episode, beside, moving=moving)
