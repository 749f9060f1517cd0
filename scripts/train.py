"""`endotwin train`: train a policy, RAM or direct RL, or the LSTM, on records."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import tyro

from rl.lstm import LstmTraining, train_lstm
from rl.training import Training, train_policy
from scripts.command import Summary, TrainingProgress, output_folder, run_verb
from scripts.records import true_records
from twin.estimation.active_model import ActiveModel
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
    """Run folder: policy.onnx, config.yaml, progress.csv, checkpoints."""
    agent: Literal["ram", "direct", "lstm"] = "ram"
    """Reinforcement active modeling, direct RL without the active model, or the LSTM baseline."""
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
    progress = TrainingProgress(f"train {args.agent}", "steps" if args.agent == "lstm" else "samples")

    if args.agent == "lstm":
        training = LstmTraining(noise=args.noise, noise_level=args.noise_level, seed=args.seed)
        train_lstm(records, active_model, training, folder, progress)
        path = folder / "lstm.pt"
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
