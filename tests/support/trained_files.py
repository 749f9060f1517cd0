"""Trained files that are made as soon as a test can wait for them."""

from pathlib import Path

from controlled import DEPLOYMENT
from models import COLEMAN_HODGDON
from small_twins import TINY, normal_laws, small_step, still_members

from rl.environment import model_record
from rl.options import TrainingOptions
from rl.training import train_policy
from rl.twins.graph import export_twins
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import KEY
from twin.reduced.members import members_to_dict

SAMPLE_TIME = 0.1


def train_ram(folder: Path) -> None:
    """Train RAM on one record of the paper's model, into `policy.onnx`."""
    options = TrainingOptions(agent="ram", episodes=4, environments=4, horizon=64, minibatch=32, seed=1)
    pull, bend = model_record(COLEMAN_HODGDON, SAMPLE_TIME)
    train_policy([(pull[:100], bend[:100])], ActiveModel(COLEMAN_HODGDON, SAMPLE_TIME), options, folder)


def export_twins_policy(folder: Path) -> None:
    """Export an untrained RAM (twins): a filter on a few still twins, whose policy is off."""
    described = {"members": members_to_dict(still_members()), KEY: DEPLOYMENT.to_dict()}
    step = normal_laws(small_step())
    export_twins(step, TINY.members, {"agent": "ram-twins"} | described, folder / "policy.onnx")
