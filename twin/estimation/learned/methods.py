"""Learned methods next to a model of hysteresis: RAM, direct RL, recurrent networks and learned gains.

Each is a `LearnedStep`; what its graph does with a sample is described where it is trained: `rl/policies.py`
(RAM and direct RL), `rl/recurrent.py` (LSTM and GRU), `rl/kalman_net.py`, and for the methods that learn on
simulated twins `rl/twins/memory_step.py` and `rl/twins/recurrent_step.py`.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.estimation.knowledge import CaseEstimator, Knowledge
from twin.estimation.learned.step import LearnedStep, OracleRun, StepState, load_step
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]
POLICY_FILE = "policy.onnx"
ANGLE_LIMIT_DEG = 25.0  # largest change of the angle by direct RL in one sample
ERROR_GAIN_LIMIT = 1.0  # largest K_RAM of the model error f [1 / s]
OBSERVATIONS = {"ram": {"phi": "sqrt(R)"}, "direct": {"y - theta": "deg", "increment of the pull": "mm"}}
"""What the policies of PPO see, by agent: name and unit."""
ACTIONS = {
    "ram": {"K_RAM of the angle": "1", "K_RAM of the model's error": "1/s"},
    "direct": {"change of theta": "deg"},
}
"""What their actions stand for."""


ON_TWINS = ("R", "zero", "ranges")
"""Information that a method gets which learned on simulated twins."""


def _learned(
    name: str,
    agent: str,
    file: str,
    purpose: str,
    *,
    given: tuple[str, ...] = ("R",),
    models: tuple[str, ...] = (),
    same_filter: bool = False,
    on_twins: bool = False,
    kind: type[LearnedStep] = LearnedStep,
) -> MethodSpec:
    """Register a method; one that needs a model runs with the identified one and at any sample time."""

    def load(file: TrainedFile) -> LearnedStep:
        return load_step(file, kind)

    def build(known: Knowledge) -> LearnedStep:
        step = load(read_trained_file(known.file_of(agent), agent))
        if models:
            return dataclasses.replace(step, model=known.reference, sample_time=known.sample_time)
        return step.at(known.sample_time) if on_twins else step

    training = Training(agent, file, load, purpose, same_filter=same_filter, on_twins=on_twins)
    return register_method(MethodSpec(name=name, given=given, build=build, models=models, training=training))


LSTM = _learned("LSTM", "lstm", "lstm.onnx", "LSTM, without a model", given=())
GRU = _learned("GRU", "gru", "gru.onnx", "GRU that knows the noise and the model")
KALMAN_NET = _learned("KalmanNet", "kalman-net", "kalman_net.onnx", "active model with a learned gain")
DIRECT = _learned(
    "Direct RL",
    "direct",
    POLICY_FILE,
    "direct RL, without the active model, by PPO",
    given=(),
    models=(ColemanHodgdon.name,),
)
RAM = _learned(
    "RAM",
    "ram",
    POLICY_FILE,
    "reinforcement active modeling, by PPO",
    models=(ColemanHodgdon.name,),
    same_filter=True,
)
"""With the measured residual, the only one that a deployed estimator has."""


OWN = _learned(
    "Own agent",
    "own",
    POLICY_FILE,
    "your own, by --agent-file or another --algorithm than PPO",
    models=(ColemanHodgdon.name,),
    same_filter=True,
)
"""Any policy on the environment of RAM or direct RL."""


def _build_oracle(known: Knowledge) -> CaseEstimator:
    estimator = RAM.build(known)
    assert isinstance(estimator, LearnedStep)
    return OracleRun(estimator)


register_method(
    MethodSpec(
        name="RAM (oracle)",
        given=("R", "truth"),
        build=_build_oracle,
        models=(ColemanHodgdon.name,),
        trained_as="ram",
        oracle=True,
    )
)


@dataclasses.dataclass(frozen=True)
class RamMemory(LearnedStep):
    """RAM with a recurrent policy; mean and covariance in its state are those of the active model."""

    def resume(self, trusted: StepState, now: StepState, pull_mm: Array, bend_deg: Array) -> StepState:
        """Return the state of a stream that starts again: the angle is moved, all else stays."""
        off = bend_deg - trusted.bend_deg
        memory = {name: of.copy() for name, of in zip(self.network.state, trusted.memory, strict=True)}
        begun = memory["covariance"].any(axis=1)  # a state of zeros has seen nothing: it stays so
        memory["mean"][:, 0] += off * begun
        memory["covariance"][:, 0] += off**2 * begun
        return now._replace(memory=tuple(memory.values()), bend_deg=bend_deg.copy())


RAM_MEMORY = _learned(
    "RAM (memory)",
    "ram-memory",
    POLICY_FILE,
    "RAM with a recurrent policy, trained on simulated twins",
    given=ON_TWINS,
    on_twins=True,
    kind=RamMemory,
)


def _rival(name: str, agent: str, purpose: str) -> MethodSpec:
    """Register a rival of RAM (twins): a published filter or network on the same twins, noises and loss."""
    return _learned(
        name, agent, "network.onnx", f"{purpose}, on simulated twins", given=ON_TWINS, on_twins=True
    )


LSTM_TWINS = _rival("LSTM (twins)", "lstm-twins", "LSTM next to a model")
GRU_TWINS = _rival("GRU (twins)", "gru-twins", "GRU next to a model")
CONVOLUTION_TWINS = _rival("TCN (twins)", "tcn-twins", "causal temporal convolution next to a model")
STATE_SPACE_TWINS = _rival("SSM (twins)", "ssm-twins", "selective state space next to a model")
KALMAN_NET_TWINS = _rival("KalmanNet (twins)", "kalman-net-twins", "active model with a learned gain")
BIASED_KALMAN_NET_TWINS = _rival(
    "KalmanNet and bias (twins)", "bias-kalman-net-twins", "the same, and the mean of the noise"
)
RECURSIVE_KALMAN_NET_TWINS = _rival(
    "Recursive KalmanNet (twins)", "recursive-kalman-net-twins", "learned gain and covariance by likelihood"
)
