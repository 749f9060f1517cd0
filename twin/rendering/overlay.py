"""Overlay: an episode, and another run, a model or a reference that is drawn over it."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.files.bounds import wrong_name
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
SAME_TIME = 1e-6  # times that differ by less are the same [s]
_LONGEST_NAME = 24  # characters of a name for which the legend has room


@dataclasses.dataclass(frozen=True)
class Overlay:
    """An episode with a ghost and a reference."""

    episode: Episode  # what is drawn
    ghost: Episode | None = None  # another run at the same times; drawn pale, below the episode
    # (N,) reference angle, NaN where none is known [deg]; empty for none
    reference_deg: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    ghost_name: str = ""  # of the ghost in the legend; empty: a ghost, with the controller of its recording
    title: str = ""  # above the episode, where there are several

    def check(self) -> None:
        """Refuse a ghost at other times, or a reference of another length."""
        time, ghost = self.episode.time, self.episode.time if self.ghost is None else self.ghost.time
        if len(ghost) != len(time) or not np.allclose(ghost, time, rtol=0, atol=SAME_TIME):
            raise InputError(f"ghost has {_span(ghost)}: must be at the times of the record, {_span(time)}")
        if len(self.reference_deg) not in (0, len(time)):
            raise InputError(f"reference has {len(self.reference_deg)} samples, the record has {len(time)}")

    @property
    def seconds(self) -> float:
        """Length of the episode [s]."""
        return float(self.episode.time[-1] - self.episode.time[0])

    @property
    def has_reference(self) -> bool:
        """True where a reference is known at some sample."""
        return bool(np.isfinite(self.reference_deg).any())

    @property
    def legend(self) -> str:
        """Name of the ghost in the legend."""
        if self.ghost_name or self.ghost is None:
            return self.ghost_name
        controller = controller_of(self.ghost)
        return f"ghost ({controller})" if controller else "ghost"

    @property
    def short_name(self) -> str:
        """Name of the ghost at its angle: without details."""
        return self.ghost_name.split(",")[0].split(" (")[0] or "ghost"

    def sample_at(self, time: float) -> int:
        """Return the first sample at or after a time since the start [s], or the last one."""
        since = self.episode.time[0] + time
        return int(np.clip(np.searchsorted(self.episode.time, since - 1e-9), 0, len(self.episode.time) - 1))


def controller_of(episode: Episode) -> str:
    """Return the controller that the metadata name; empty where they name none that can be written."""
    name = episode.metadata.get("controller", "")
    if wrong_name(name):
        return ""
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…"


def _span(time: Array) -> str:
    return f"{len(time)} samples from {time[0]:g} to {time[-1]:g} s"


def with_model(episode: Episode, model: HysteresisModel, name: str) -> Overlay:
    """Return an episode with the response of a model to its command as a ghost."""
    bend_deg = model.response(episode.pull_mm, episode.truth_deg[0])
    rmse = float(np.sqrt(np.mean((bend_deg - episode.truth_deg) ** 2)))
    return Overlay(episode, _arc(episode, bend_deg), ghost_name=f"{name}, RMSE {rmse:.2f}°")


def with_command(episode: Episode, reference_deg: Array) -> Overlay:
    """Return an episode with the commanded bend as a ghost.

    It is the reference (N,) of a controlled run [deg], where one is known. Of any other one it is the line of
    least squares through its loop: where the tip would be if a pull always gave the same angle.
    """
    pull, bend = episode.pull_mm, episode.truth_deg
    if np.isfinite(reference_deg).any():
        commanded, name = np.where(np.isfinite(reference_deg), reference_deg, bend), "commanded (reference)"
    else:
        slope, offset = np.polyfit(pull, bend, 1) if np.ptp(pull) else (0.0, bend.mean())
        commanded, name = slope * pull + offset, "commanded (straight line)"
        reference_deg = np.empty(0)
    return Overlay(episode, _arc(episode, commanded), reference_deg, name)


def _arc(episode: Episode, bend_deg: Array) -> Episode:
    """Return the episode with another bend, in the shape of an even arc, and without hidden state."""
    bend, vertebrae = np.radians(bend_deg), episode.joint_angle.shape[1]
    return dataclasses.replace(
        episode,
        bend=bend,
        measured_bend=bend,
        joint_angle=np.repeat(bend[:, None] / max(vertebrae, 1), vertebrae, axis=1),
        wire_tension=np.zeros((len(bend), episode.wire_tension.shape[1], 0)),
        wire_slack=np.empty(0),
        metadata={name: value for name, value in episode.metadata.items() if name != "controller"},
    )
