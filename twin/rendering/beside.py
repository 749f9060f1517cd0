"""Company of an episode in a picture: another run or a model, as a ghost, and what both were to follow."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.files.bounds import wrong_name
from twin.rendering.theme import Theme
from twin.rendering.trace_panel import Curve

Array = NDArray[np.float64]

SAME_TIME = 1e-6
"""Times that differ by less are the same [s]."""
_LONGEST_NAME = 24  # characters of a name for which the legend has room


@dataclasses.dataclass(frozen=True)
class Beside:
    """Ghost and reference that are drawn with an episode.

    Attributes:
        ghost: record of another run at the same times; drawn pale, behind the episode.
        reference_deg: (N,) angle that was wanted, NaN where none is known [deg]; empty for none.
        ghost_name: what the ghost is, in the legend; empty: a ghost, of the controller of its record.
    """

    ghost: Episode | None = None
    reference_deg: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    ghost_name: str = ""

    def check(self, episode: Episode) -> None:
        """Refuse what is not at the times of an episode.

        Raises:
            ValueError: the ghost has other times, or the reference another number of samples.
        """
        time = episode.time
        if self.ghost is not None and not (
            len(self.ghost.time) == len(time) and np.allclose(self.ghost.time, time, rtol=0, atol=SAME_TIME)
        ):
            raise InputError(
                f"ghost has {_span(self.ghost)}: must be at the times of the record, {_span(episode)}"
            )
        if len(self.reference_deg) not in (0, len(time)):
            raise InputError(f"reference has {len(self.reference_deg)} samples, the record has {len(time)}")

    @property
    def has_reference(self) -> bool:
        """True where an angle that was wanted is known at some sample."""
        return bool(np.isfinite(self.reference_deg).any())

    @property
    def called(self) -> str:
        """Name of the ghost in the legend."""
        if self.ghost_name or self.ghost is None:
            return self.ghost_name
        whose = controller_of(self.ghost)
        return f"ghost ({whose})" if whose else "ghost"

    @property
    def short_name(self) -> str:
        """Name of the ghost beside its angle: without what is told of it."""
        return self.ghost_name.split(",")[0].split(" (")[0] or "ghost"


NOTHING = Beside()
"""No ghost and no reference."""


def curves_of(over: str, episode: Episode, beside: Beside, theme: Theme, *, moving: bool) -> list[Curve]:
    """Return the bend of an episode, and of its ghost behind it, over `pull_mm` or `time`.

    Args:
        over: name of an array of the episode, along the horizontal axis.
        episode: the record.
        beside: what is drawn with it; names tell curves apart where there is anything.
        theme: colours.
        moving: True where a trace moves over the curve, which is then pale; False where it is the trace.
    """
    x, bend_deg = getattr(episode, over), episode.truth_deg
    name = ""
    if beside.ghost is not None or beside.has_reference:
        name = controller_of(episode) or ("twin" if beside.ghost_name else "bend")
    curves = []
    if beside.ghost is not None:
        along = getattr(beside.ghost, over)
        curves.append(Curve(along, beside.ghost.truth_deg, theme.ghost, dashed=True, name=beside.called))
    if not moving:
        return [*curves, Curve(x, bend_deg, theme.trace, name=name)]
    key = [Curve(x[:0], bend_deg[:0], theme.trace, name=name)] if name else []  # the trace to come
    return [*curves, Curve(x, bend_deg, theme.pale), *key]


def controller_of(episode: Episode) -> str:
    """Return the controller that the metadata name; empty where they name none that can be written."""
    name = episode.metadata.get("controller", "")
    if wrong_name(name):
        return ""
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…"


def _span(episode: Episode) -> str:
    time = episode.time
    return f"{len(time)} samples from {time[0]:g} to {time[-1]:g} s"
