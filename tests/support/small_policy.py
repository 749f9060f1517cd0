"""The paper's RAM, trained for as long as a test can wait."""

import fcntl
from pathlib import Path

from models import COLEMAN_HODGDON

from rl.environment import model_record
from rl.options import TrainingOptions
from rl.training import train_policy
from twin.estimation.active_model import ActiveModel

SAMPLE_TIME = 0.1


def shared(folder: Path) -> Path:
    """Train in a folder, or take what another process of these tests has trained there."""
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return train(folder / "ram")  # a finished training is left as it is


def train(folder: Path) -> Path:
    """Train on one record of the paper's model; returns `policy.onnx`."""
    options = TrainingOptions(agent="ram", episodes=4, environments=4, horizon=64, minibatch=32, seed=1)
    pull, bend = model_record(COLEMAN_HODGDON, SAMPLE_TIME)
    active_model = ActiveModel(COLEMAN_HODGDON, SAMPLE_TIME)
    return train_policy([(pull[:100], bend[:100])], active_model, options, folder)
