"""Ghosts that are no record: what a model of hysteresis says of a command, and what was commanded."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.hysteresis import HysteresisModel
from twin.rendering.beside import Beside

Array = NDArray[np.float64]


def model_ghost(episode: Episode, model: HysteresisModel, name: str) -> Beside:
    """Return the bend that a model has along the command of a record, from the record's own first angle on.

    Args:
        episode: the record.
        model: identified model.
        name: of it, in the legend; how far it is off is added.
    """
    bend_deg = model.response(episode.pull_mm, episode.truth_deg[0])
    off = float(np.sqrt(np.mean((bend_deg - episode.truth_deg) ** 2)))
    return Beside(ghost=_standing(episode, bend_deg), ghost_name=f"{name}, RMSE {off:.2f}°")


def commanded_ghost(episode: Episode, reference_deg: Array) -> Beside:
    """Return the bend that was commanded, as a ghost.

    It is the reference of a controlled run, where one is known. Of any other record it is the straight line
    of least squares through its loop: where the tip would be if a pull always gave the same angle.

    Args:
        episode: the record.
        reference_deg: (N,) angle that was wanted, NaN where none is known [deg]; empty for none.
    """
    if np.isfinite(reference_deg).any():
        known = np.where(np.isfinite(reference_deg), reference_deg, episode.truth_deg)
        return Beside(_standing(episode, known), reference_deg, ghost_name="commanded (reference)")
    slope, offset = _line(episode.pull_mm, episode.truth_deg)
    return Beside(
        _standing(episode, slope * episode.pull_mm + offset), ghost_name="commanded (straight line)"
    )


def _line(pull_mm: Array, bend_deg: Array) -> tuple[float, float]:
    if np.ptp(pull_mm) == 0:
        return 0.0, float(bend_deg.mean())
    slope, offset = np.polyfit(pull_mm, bend_deg, 1)
    return float(slope), float(offset)


def _standing(episode: Episode, bend_deg: Array) -> Episode:
    """Return the record with another bend, in the shape of an even arc, and without hidden state."""
    bend, count = np.radians(bend_deg), len(episode.time)
    vertebrae = max(episode.joint_angle.shape[1], 1)
    even = np.repeat(bend[:, None] / vertebrae, vertebrae, axis=1)
    return dataclasses.replace(
        episode,
        bend=bend,
        measured_bend=bend,
        joint_angle=even if episode.joint_angle.shape[1] else episode.joint_angle,
        wire_tension=np.zeros((count, episode.wire_tension.shape[1], 0)),
        wire_slack=np.empty(0),
        metadata={name: value for name, value in episode.metadata.items() if name != "controller"},
    )
