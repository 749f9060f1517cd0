"""Tracking policies that hardly anything was taught to, for tests of what runs them."""

import dataclasses
from pathlib import Path

from rl.tracking_training import TrackingTraining, train_tracking

TINY = TrackingTraining(samples=64, horizon=32, environments=2, minibatch=32)


def write_tiny(path: Path, **changes) -> Path:
    """Write the policy of a training of a few samples, with some of its settings changed."""
    train_tracking(path, training=dataclasses.replace(TINY, **changes))
    return path
