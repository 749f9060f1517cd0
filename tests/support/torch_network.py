"""A step of torch as a running estimator calls it, without a file."""

import copy

import numpy as np
import torch

from rl.policies import PolicyStep
from twin.estimation.learned.step import LearnedStep, StepNetwork


class TorchFile:
    """A step of torch in the place of a trained file: named arrays in, arrays out, in double precision."""

    precision = np.float64

    def __init__(self, step):
        self.step = copy.deepcopy(step).double()
        self.names = (*step.inputs, *step.state)

    def run(self, **values):
        given = [torch.tensor(np.asarray(values[name], float)) for name in self.names]
        with torch.no_grad():
            return [of.numpy() for of in self.step(*given)]


def as_estimator(step, model=None, sample_time=0.1, **fields):
    """Return an estimator that runs an instance of torch."""
    state = step.state if isinstance(step.state, dict) else dict.fromkeys(step.state, ())
    first = step.start if isinstance(step, PolicyStep) else {}
    network = StepNetwork(TorchFile(step), step.inputs, state, False, first)
    sensor = {"measurement_variance": 0.1} | fields
    return LearnedStep(network, model if "keep" in step.inputs else None, sample_time, **sensor)


class Constant(torch.nn.Module):
    """A policy of one action, whatever it sees."""

    def __init__(self, *action):
        super().__init__()
        self.action = torch.nn.Buffer(torch.tensor(action))

    def forward(self, seen):
        return torch.zeros_like(seen[:, :1]) + self.action
