"""`endotwin train`: train a policy, RAM or direct RL, or another learned filter, on records."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import tyro

from rl.agents import AGENTS
from rl.gru import GRU_FILE, train_gru
from rl.kalman_net import KALMAN_NET_FILE, KalmanNetTraining, train_kalman_net
from rl.lstm import LSTM_FILE, train_lstm
from rl.supervised import SequenceTraining
from rl.training import Training, train_policy
from scripts.command import Summary, TrainingProgress, output_folder, run_verb
from twin.estimation.active_model import ActiveModel
from twin.evaluation.reading import true_records
from twin.hysteresis import load_model

STRICT = {"noise": "gaussian", "noise_level": 0.1}


@dataclasses.dataclass(frozen=True)
class Train:
    """Train a policy by PPO on records, the paper's Table I as defaults; a stopped run is taken up again."""

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    model: Path
    """coleman_hodgdon.json of the reference model."""
    out: Path
    """Run folder: policy.onnx or the network's file, config.yaml, progress.csv, checkpoints of a policy."""
    agent: Literal["ram", "direct", "lstm", "gru", "kalman-net"] = "ram"
    """Reinforcement active modeling, direct RL without the active model, the LSTM baseline, a GRU that knows
    the noise and the model, or the active model with a learned gain (KalmanNet)."""
    protocol: Literal["strict", "free"] = "strict"
    """strict: trained under Gaussian noise of R = 0.1 alone, as in the paper; free: noise as given."""
    sample_time: float = 0.1
    """T [s]; records are thinned to it."""
    episodes: int = Training.episodes
    """Episodes of PPO in all."""
    learning_rate: float = Training.learning_rate
    horizon: int = Training.horizon
    """Samples between two updates, over all environments."""
    discount: float = Training.discount
    minibatch: int = Training.minibatch
    """Samples in one gradient step."""
    clip: float = Training.clip
    """Clip factor of PPO."""
    environments: int = Training.environments
    """Episodes that run side by side."""
    noise: str = Training.noise
    """Measurement noise during training (protocol free)."""
    noise_level: float = Training.noise_level
    """Its level [deg^2 or deg] (protocol free)."""
    reward_scale: float = Training.reward_scale
    """Factor on the reward, eq. 11."""
    initial_error_deg: float = Training.initial_error_deg
    """The initial estimate is off by up to this [deg]."""
    seed: int = 0
    json: bool = False
    """Print the summary as one JSON object."""


def train(args: Train) -> Summary:
    """Fill a run folder."""
    given = {name: getattr(args, name) for name in STRICT}
    if args.protocol == "strict" and given != STRICT:
        raise ValueError(f"--protocol strict trains under {STRICT}: use --protocol free for {given}")
    active_model = ActiveModel(
        load_model(args.model), args.sample_time, measurement_variance=args.noise_level
    )
    records = true_records(args.data, args.sample_time)
    folder = output_folder(args.out)
    progress = TrainingProgress(f"train {args.agent}", "samples" if args.agent in AGENTS else "steps")
    drawn: dict[str, Any] = {"noise": args.noise, "noise_level": args.noise_level, "seed": args.seed}

    if args.agent == "lstm":
        train_lstm(records, active_model, SequenceTraining(**drawn), folder, progress)
        path = folder / LSTM_FILE
    elif args.agent == "gru":
        train_gru(records, active_model, SequenceTraining(**drawn), folder, progress)
        path = folder / GRU_FILE
    elif args.agent == "kalman-net":
        gain = KalmanNetTraining(**drawn, initial_error_deg=args.initial_error_deg)
        train_kalman_net(records, active_model, gain, folder, progress)
        path = folder / KALMAN_NET_FILE
    else:
        names = [field.name for field in dataclasses.fields(Training)]
        ppo = Training(**{name: getattr(args, name) for name in names})
        path = train_policy(records, active_model, ppo, folder, progress)
    return Summary(
        f"{path}: {args.agent} trained on {len(records)} records", {"out": str(path), "agent": args.agent}
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Train, train, argv)


if __name__ == "__main__":
    sys.exit(main())
