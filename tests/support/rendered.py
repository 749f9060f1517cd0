"""Episodes to draw, and small pictures of them."""

import dataclasses

import numpy as np
import pytest

from twin.episode import Episode
from twin.physics import choose_backend
from twin.rendering.look import Look
from twin.rendering.overlay import Overlay
from twin.rendering.render import Film

needs_gl = pytest.mark.skipif(choose_backend() == "disable", reason="nothing here draws without a screen")
VERTEBRAE = 16
SMALL = (320, 180)
STRAIGHT, UP, DOWN = 0, 10, 30  # samples of the episode below


def make_episode(*, hinges: int = VERTEBRAE, amplitude_deg: float = 80) -> Episode:
    """A sine of pull, and a bend that follows it a little late, without simulation."""
    time = np.arange(41) * 0.1
    bend = np.radians(amplitude_deg) * np.sin(2 * np.pi * time / 4)
    return Episode(
        time=time,
        pull=2e-3 * np.sin(2 * np.pi * time / 4 + 0.4),
        bend=bend,
        measured_bend=bend,
        joint_angle=np.repeat(bend[:, None] / VERTEBRAE, VERTEBRAE, axis=1)[:, :hinges],
        wire_tension=np.zeros((41, 2, 1)),
        sheath_friction=np.zeros((41, 2, 0)),
    )


def with_tension(episode: Episode, highest_n: float = 37.0) -> Episode:
    """The same with tension in three lengths of each wire: of the pulled one, and less towards the tip."""
    pulled = episode.pull / np.abs(episode.pull).max()
    both = np.stack([np.clip(pulled, 0, 1), np.clip(-pulled, 0, 1)], axis=1)
    return dataclasses.replace(episode, wire_tension=highest_n * both[:, :, None] * [1.0, 0.7, 0.4])


def in_two_planes(episode: Episode) -> Episode:
    """The same, bent sideways too, a quarter of a turn later."""
    late = np.roll(episode.bend, 10) / 2
    return dataclasses.replace(
        episode,
        lateral_pull=np.roll(episode.pull, 10) / 2,
        lateral_bend=late,
        lateral_joint_angle=np.repeat(late[:, None] / VERTEBRAE, VERTEBRAE, axis=1),
        wire_tension=np.zeros((41, 4, 1)),
        sheath_friction=np.zeros((41, 4, 0)),
        metadata={"preset": {"bending_planes": 2}},
    )


def film(of: Episode | Overlay, *, size: tuple[int, int] = SMALL, speed: float | None = None, **look) -> Film:
    """A film of one episode."""
    return Film([of if isinstance(of, Overlay) else Overlay(of)], Look(size=size, **look), speed)


def ink(picture: np.ndarray) -> np.ndarray:
    """How far each pixel of a picture on white is from white."""
    return 255 - picture.astype(float).min(axis=-1)
