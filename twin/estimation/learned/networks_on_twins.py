"""Rivals of RAM (twins) with the same means: published filters and networks that learn on the same twins.

The figures of a method that learned on thousands of randomised twins under every noise say little beside
those of one that saw five records under one. So these learn on the same twins, commands and noises, by the
same loss, for as many updates. All run beside the model of Coleman and Hodgdon that is identified on the
nominal endoscope, are told R and T, see the same numbers, and state an interval;
`rl/twins/recurrent_step.py` has what they do with a sample, `rl/twins/cells.py` what remembers.
"""

from pathlib import Path

from twin.estimation.knowledge import Knowledge
from twin.estimation.learned.model_step import ModelStep, load_model_step
from twin.estimation.registry import MethodSpec, Training, register_method

STATE = {"values": 1, "hidden": 1, "samples": 0}
"""Axes of each array of the state of one filter."""
FILE = "network.onnx"


def _register(name: str, agent: str, purpose: str) -> MethodSpec:
    """Add a rival to the method table; only those that are named, or trained, are compared."""

    def load(path: Path) -> ModelStep:
        return load_model_step(path, agent, STATE, ModelStep)

    def build(known: Knowledge) -> ModelStep:
        return load(known.file_of(agent)).at(known.sample_time)

    training = Training(agent, FILE, load, purpose, on_twins=True)
    return register_method(
        MethodSpec(
            name=name,
            noise_information="R",
            build=build,
            training=training,
        )
    )


LSTM_TWINS = _register("LSTM (twins)", "lstm-twins", "LSTM beside a model, on simulated twins")
GRU_TWINS = _register("GRU (twins)", "gru-twins", "GRU beside a model, on simulated twins")
CONVOLUTION_TWINS = _register(
    "TCN (twins)", "tcn-twins", "causal temporal convolution beside a model, on simulated twins"
)
STATE_SPACE_TWINS = _register(
    "SSM (twins)", "ssm-twins", "selective state space beside a model, on simulated twins"
)
KALMAN_NET_TWINS = _register(
    "KalmanNet (twins)", "kalman-net-twins", "active model with a learned gain, on simulated twins"
)
BIASED_KALMAN_NET_TWINS = _register(
    "KalmanNet and bias (twins)",
    "bias-kalman-net-twins",
    "the same, and the mean of the noise, on simulated twins",
)
RECURSIVE_KALMAN_NET_TWINS = _register(
    "Recursive KalmanNet (twins)",
    "recursive-kalman-net-twins",
    "learned gain and covariance by likelihood, on simulated twins",
)
