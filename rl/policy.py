"""A trained policy as an ONNX file that carries its own description, and running it without torch."""

import dataclasses
import json
import logging
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO

from rl.agents import Agent, check_agent_name, make_agent
from twin.estimation.active_model import ActiveModel
from twin.hysteresis import model_from_dict

Array = NDArray[np.float64]
_METADATA_KEY = "endotwin"


@dataclasses.dataclass(frozen=True)
class Policy:
    """A deterministic policy and the agent that it was trained in."""

    session: onnxruntime.InferenceSession
    agent_name: str
    configuration: dict[str, Any]
    path: Path | None = None
    """Where it was read from: another process reads it there too."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to a worker process as a path, as a session cannot."""
        if self.path is None:
            raise TypeError("a policy that was not read from a file cannot be sent to another process")
        return load_policy, (self.path,)

    def __call__(self, observation: Array) -> Array:
        """Return (B, action_size) actions in [-1, 1] for (B, observation_size) observations."""
        return self.session.run(None, {"observation": np.asarray(observation, dtype=np.float32)})[0].astype(
            float
        )

    @property
    def active_model(self) -> ActiveModel:
        """The filter that the policy was trained beside."""
        values = dict(self.configuration["active_model"])
        model = model_from_dict(values.pop("model"))
        for name in ("process_variance", "initial_variance"):
            values[name] = tuple(values[name])
        return ActiveModel(model, **values)

    def agent(self, active_model: ActiveModel) -> Agent:
        """Return a fresh agent of the kind that the policy steers."""
        return make_agent(self.agent_name, active_model)


def export_policy(ppo: PPO, agent_name: str, configuration: dict[str, Any], path: Path) -> None:
    """Write the mean action of a trained policy, clipped to [-1, 1], as ONNX, whole or not at all."""
    observation_size = ppo.observation_space.shape[0]  # type: ignore[index]
    partial = path.with_name(f".{path.stem}.partial.onnx")
    # It would name operators of packages that we do not use.
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # between torch and its exporter
        torch.onnx.export(
            _MeanAction(ppo).eval(),
            (torch.zeros(2, observation_size),),
            str(partial),
            input_names=["observation"],
            output_names=["action"],
            dynamic_shapes={"observation": {0: torch.export.Dim("batch")}},
            dynamo=True,
            external_data=False,
            verbose=False,
        )
    graph = onnx.load(str(partial))
    description = {"agent": agent_name, **configuration}
    onnx.helper.set_model_props(graph, {_METADATA_KEY: json.dumps(description)})
    onnx.save(graph, str(partial))
    os.replace(partial, path)


def load_policy(path: Path) -> Policy:
    """Read a policy.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is no ONNX model, or not one that `export_policy` wrote.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no policy file {path}; `endotwin train` writes one")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        text = session.get_modelmeta().custom_metadata_map[_METADATA_KEY]
        configuration = json.loads(text)
        name = configuration.pop("agent")
    except Exception as error:  # onnxruntime raises its own classes for a file that it cannot read
        raise ValueError(f"{path} is not a policy written by `endotwin train`") from error
    check_agent_name(name)
    return Policy(session, name, configuration, path)


class _MeanAction(torch.nn.Module):
    """The network from observation to clipped mean action, without value function and exploration."""

    def __init__(self, ppo: PPO):
        super().__init__()
        self.hidden = ppo.policy.mlp_extractor.policy_net
        self.mean = ppo.policy.action_net

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.mean(self.hidden(observation)).clamp(-1, 1)
