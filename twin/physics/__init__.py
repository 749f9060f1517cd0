"""MuJoCo simulation of the endoscope: model, readings, friction, drive, single and batch runs."""

from twin.physics import headless  # noqa: F401  chooses MUJOCO_GL before dm_control is imported
from twin.physics.batch import EndoscopeBatch, simulate_batch
from twin.physics.endoscope import Endoscope, State
from twin.physics.model import model_xml
from twin.physics.simulation import MUJOCO, simulate

__all__ = [
    "MUJOCO",
    "Endoscope",
    "EndoscopeBatch",
    "State",
    "model_xml",
    "simulate",
    "simulate_batch",
]
