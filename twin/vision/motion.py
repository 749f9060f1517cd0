"""Motion of a record: its poses at any time, linear between samples."""

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.physics.drawing.frames import Frames, link_frames
from twin.preset.preset import Preset
from twin.rendering.actor import hinge_angles_of

Array = NDArray[np.float64]


class Motion:
    """Poses of a record.

    Attributes:
        tip: (N, 3) place of the tip at each sample [m].
    """

    def __init__(self, episode: Episode, preset: Preset) -> None:
        """Compute the way of the tip.

        Args:
            episode: the record; one without hinge angles bends as an even arc.
            preset: length of the section.
        """
        self._time, self._length = episode.time, preset.section_length
        self._own, self._lateral = hinge_angles_of(episode), episode.lateral_joint_angle
        self.tip = link_frames(self._own, self._lateral, self._length).position[:, -1]

    def links_at(self, time: float) -> Frames:
        """Return the frames of the links at a time [s], (1, vertebrae + 1)."""
        own = self._at(self._own, time)
        lateral = self._at(self._lateral, time) if len(self._lateral) else self._lateral
        return link_frames(own, lateral, self._length)

    def speed(self, sample: int) -> float:
        """Return the speed of the tip about a sample [m / s]."""
        before, after = max(sample - 1, 0), min(sample + 1, len(self._time) - 1)
        way = np.linalg.norm(self.tip[after] - self.tip[before])
        return float(way / (self._time[after] - self._time[before]))

    def _at(self, values: Array, instant: float) -> Array:
        """Return values (N, columns) at an instant, (1, columns); those of the ends before and after."""
        time = self._time
        after = int(np.clip(np.searchsorted(time, instant), 1, len(time) - 1))
        share = np.clip((instant - time[after - 1]) / (time[after] - time[after - 1]), 0.0, 1.0)
        between: Array = (1 - share) * values[after - 1 : after] + share * values[after : after + 1]
        return between
