"""Roundness of the tip's path along a circle of commands, of an endoscope that has its plane twice."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.kinematics import link_frames
from twin.preset.preset import Preset
from twin.reduced import simulate_batch

Array = NDArray[np.float64]

PERIOD = 16.0  # of a turn [s]
SAMPLE_TIME = 0.05  # [s]
TURNS = 2.25  # the last one is compared
START = 0.3  # direction that the circle starts in [rad]; it makes no difference to the last turn


def out_of_round(presets: Sequence[Preset], radii: Sequence[float]) -> Array:
    """Return how far the tip's path is from a circle about its middle, as a share of its radius.

    It is seen along the shaft. An initial bend shifts the path, which is as round for that.

    Args:
        presets: B endoscopes; what they have of a second plane is that of the first.
        radii: of the circle of commands [m].

    Returns:
        (B, radii); infinity where the tip stays, or has no equilibrium.
    """
    angle = START + 2 * np.pi * np.arange(0, TURNS * PERIOD, SAMPLE_TIME) / PERIOD
    two = [
        p.replace(bending_planes=2, lateral_initial_bend=p.initial_bend, lateral_command_zero=p.command_zero)
        for p in presets
    ]
    runs = [(preset, radius) for preset in two for radius in radii]
    episodes = simulate_batch(
        [preset for preset, _ in runs],
        [radius * np.cos(angle) for _, radius in runs],
        SAMPLE_TIME,
        lateral_pulls=[radius * np.sin(angle) for _, radius in runs],
    )
    shares, turn = np.full(len(runs), np.inf), slice(-round(PERIOD / SAMPLE_TIME), None)
    for number, ((preset, _), episode) in enumerate(zip(runs, episodes, strict=True)):
        if episode is not None:
            angles = (episode.joint_angle[turn], episode.lateral_joint_angle[turn])
            tip = link_frames(*angles, preset.section_length).position[:, -1]
            shares[number] = path_out_of_round(tip)
    return shares.reshape(len(presets), len(radii))


def path_out_of_round(tip: Array) -> float:
    """Return how far a turn of the tip is from a circle, as a share of its radius; infinity where it stays.

    Args:
        tip: (N, 3) its position along the turn [m].
    """
    reach = np.hypot(*(tip - tip.mean(axis=0)).T[1:])
    return float(np.abs(reach / reach.mean() - 1).max()) if reach.any() else np.inf
