"""Every learned method: trained into a folder of its own, and read back as the methods of the tables."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.gru import GRU_FILE, load_gru, train_gru
from rl.kalman_net import KALMAN_NET_FILE, KalmanNetTraining, load_kalman_net, train_kalman_net
from rl.lstm import LSTM_FILE, LstmEstimator, load_lstm, train_lstm
from rl.methods import oracle_method, policy_method
from rl.policy import load_policy
from rl.supervised import SequenceTraining
from rl.training import Training, train_policy
from twin.estimation.active_model import ActiveModel
from twin.evaluation.method import Method, as_method

Records = Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]

LEARNED = ("ram", "direct", "lstm", "gru", "kalman-net")
PAPER_SAMPLE_TIME = 0.1  # at which `Training.episodes` is meant [s]

_NETWORKS: dict[str, tuple[Any, Callable[..., Any]]] = {
    "lstm": (SequenceTraining, train_lstm),
    "gru": (SequenceTraining, train_gru),
    "kalman-net": (KalmanNetTraining, train_kalman_net),
}


def train_learned(
    agent: str, records: Records, active_model: ActiveModel, folder: Path, episodes: int, seed: int
) -> None:
    """Train one method of `LEARNED` under the strict protocol; a finished one is left as it is.

    Args:
        agent: which.
        records: `(pull_mm, bend_deg)` at the sample time of the active model.
        active_model: what methods that know a model are built on.
        folder: where `folder / agent` is made.
        episodes: of PPO at T = 0.1 s; at another T as many samples. A network takes as large a share of its
            own steps as this is of the paper's episodes.
        seed: of the training.
    """
    torch.set_num_threads(1)
    if agent in _NETWORKS:
        settings, train = _NETWORKS[agent]
        iterations = max(round(settings.iterations * episodes / Training.episodes), 1)
        train(records, active_model, settings(iterations=iterations, seed=seed), folder / agent)
        return
    count = max(round(episodes * active_model.sample_time / PAPER_SAMPLE_TIME), 1)
    train_policy(records, active_model, Training(agent=agent, episodes=count, seed=seed), folder / agent)


def learned_methods(active_model: ActiveModel, folder: Path) -> list[Method]:
    """Return what `train_learned` has left in a folder, all of `LEARNED`, and RAM's oracle."""
    ram, direct = (load_policy(folder / agent / "policy.onnx") for agent in ("ram", "direct"))
    return [
        as_method("LSTM", LstmEstimator(load_lstm(folder / "lstm" / LSTM_FILE))),
        as_method("GRU", load_gru(folder / "gru" / GRU_FILE)),
        as_method("KalmanNet", load_kalman_net(folder / "kalman-net" / KALMAN_NET_FILE)),
        policy_method(direct, active_model),
        policy_method(ram, active_model),
        oracle_method(ram, active_model),
    ]
