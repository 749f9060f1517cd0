"""Residuals of candidate presets against logs: all candidates times all logs in one batch simulation."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.measured import MeasuredLoop
from twin.episode import Episode
from twin.physics import simulate_batch
from twin.preset.preset import Preset

Array = NDArray[np.float64]

BEND_SCALE = np.radians(1.0)
"""Scale of the angle residuals [rad]: an error of this size costs 1."""
TENSION_SHARE = 0.1
"""Scale of the tension residuals, relative to their range: both tensions off by this cost 1 together."""
_HOPELESS = 1e3  # residual of a candidate whose simulation diverged


def predict(presets: Sequence[Preset], loops: Sequence[MeasuredLoop]) -> list[list[Episode | None]]:
    """Simulate every candidate along every log; returns (candidates, logs), None where one diverged.

    The wires are wound up in the sheath as it is bent in that log.
    """
    pairs = [
        (preset if loop.sheath_bend is None else preset.replace(sheath_bend=loop.sheath_bend), loop)
        for preset in presets
        for loop in loops
    ]
    episodes = simulate_batch(
        [preset for preset, _ in pairs],
        [loop.pull for _, loop in pairs],
        loops[0].sample_time,
    )
    count = len(loops)
    return [episodes[start : start + count] for start in range(0, len(pairs), count)]


def residuals(presets: Sequence[Preset], loops: Sequence[MeasuredLoop]) -> Array:
    """Return the weighted residuals of candidates against logs.

    Each log weighs the same: its squared differences are divided by its number of samples.

    Returns:
        (candidates, R); the sum of squares of a row is the cost of that candidate.
    """
    return np.array(
        [
            np.concatenate([_of_log(episode, loop) for episode, loop in zip(episodes, loops, strict=True)])
            for episodes in predict(presets, loops)
        ]
    )


def _of_log(episode: Episode | None, loop: MeasuredLoop) -> Array:
    count = np.count_nonzero(loop.fitted)
    parts = 1 + loop.tension.shape[1]
    if episode is None:
        return np.full(count * parts, _HOPELESS / np.sqrt(count))
    off = [(episode.bend - loop.bend)[loop.fitted] / BEND_SCALE]
    if loop.tension.size:
        scale = np.sqrt(2) * TENSION_SHARE * loop.tension_range
        off += list((episode.tension[:, :2] - loop.tension)[loop.fitted].T / scale)
    weighted: Array = np.concatenate(off) / np.sqrt(count)
    return weighted
