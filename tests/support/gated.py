"""Material that tests of the gate share: a little evidence, logs, and policies that nothing was taught to."""

import dataclasses

import numpy as np
from small_twins import TINY, small_members, small_step, twins

from rl.twins.graph import export_twins
from twin.estimation.deployment import KEY, prepare_deployment
from twin.gate.evidence import Effort, gather
from twin.hysteresis import ColemanHodgdon
from twin.reduced import simulate
from twin.reduced.members import members_to_dict
from twin.signals.excitation import command

SMALL = Effort(kinds=1, twins=2, draws=1, log_draws=1, seconds=10.0, log_samples=100, hostile=600, pushes=40)
T = 0.1


def logs_on(preset, stroke_mm, count=2, seconds=12.0, seed=3):
    """Logs of an endoscope on a stroke."""
    rng = np.random.default_rng(seed)
    metres = (stroke_mm[0] * 1e-3, stroke_mm[1] * 1e-3)
    episodes = [
        simulate(preset, command(kind, metres, seconds, T, rng), T) for kind in ("sine", "multi-sine")[:count]
    ]
    return [
        dataclasses.replace(episode, metadata=episode.metadata | {"name": f"log_{number}"})
        for number, episode in enumerate(episodes)
    ]


def material_of(path, episodes=(), preset=None, ranges=None, **more):
    own, its = twins()
    return gather(path, preset or own, ranges or its, episodes, size=SMALL, **more)


def deployment():
    """A fallback and limits, as every trained file carries them."""
    records = [(log.pull_mm, log.truth_deg) for log in logs_on(twins()[0], (-4.0, 4.0))]
    return prepare_deployment(records, ColemanHodgdon(1.33, 22.3, 3.4), T, seed=0).to_dict()


def export_small(path):
    """Write an untrained step of RAM (twins)."""
    preset, ranges = twins()
    description = {
        "agent": "ram-twins",
        "preset": preset.to_dict(),
        "ranges": ranges.to_dict(),
        "members": members_to_dict(small_members()),
        "training": {"stroke_mm": [-4.0, 4.0]},
        KEY: deployment(),
    }
    export_twins(small_step(), TINY.members, description, path)
    return path
