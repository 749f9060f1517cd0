"""`endotwin train`: train a policy, RAM or direct RL, or another learned filter, on records."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro

from rl.options import TrainingOptions
from scripts.command import Summary, run_verb
from scripts.outputs import output_folder
from scripts.progress import TrainingProgress
from twin.estimation.registry import find_training, trainings

STRICT = {"noise": "gaussian", "noise_level": 0.1}


def agents_in_words(default: str = "") -> str:
    """Return the agents that there are, each with its purpose, for the help of the command line."""
    return "; ".join(f"{agent}: {training.purpose}" for agent, training in trainings().items())


@dataclasses.dataclass(frozen=True)
class Train:
    """Train a policy by PPO on records, the paper's Table I as defaults; a stopped run is taken up again."""

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    model: Path
    """coleman_hodgdon.json of the reference model."""
    out: Path
    """Run folder: policy.onnx or the network's file, config.yaml, progress.csv."""
    agent: Annotated[str, tyro.conf.arg(help_behavior_hint=agents_in_words)] = TrainingOptions().agent
    """Learned method."""
    protocol: Literal["strict", "free"] = "strict"
    """strict: trained under Gaussian noise of R = 0.1 alone, as in the paper; free: noise as given."""
    sample_time: float = 0.1
    """T [s]; records are thinned to it."""
    episodes: int = TrainingOptions.episodes
    """Episodes of PPO in all; a network takes as large a share of its own steps as this is of the default."""
    learning_rate: float = TrainingOptions.learning_rate
    """Of PPO."""
    horizon: int = TrainingOptions.horizon
    """Samples between two updates, over all environments."""
    discount: float = TrainingOptions.discount
    """Discount factor of PPO."""
    minibatch: int = TrainingOptions.minibatch
    """Samples in one gradient step."""
    clip: float = TrainingOptions.clip
    """Clip factor of PPO."""
    environments: int = TrainingOptions.environments
    """Episodes that run side by side."""
    noise: str = TrainingOptions.noise
    """Measurement noise during training (protocol free)."""
    noise_level: float = TrainingOptions.noise_level
    """Its level [deg^2 or deg] (protocol free)."""
    reward_scale: float = TrainingOptions.reward_scale
    """Factor on the reward, eq. 11."""
    initial_error_deg: float = TrainingOptions.initial_error_deg
    """The initial estimate is off by up to this [deg]."""
    seed: int = 0
    """Of the network, the exploration and the noise."""
    json: bool = False
    """Print the summary as one JSON object."""


def train(args: Train) -> Summary:
    """Fill a run folder."""
    given = {name: getattr(args, name) for name in STRICT}
    if args.protocol == "strict" and given != STRICT:
        raise ValueError(f"--protocol strict trains under {STRICT}: use --protocol free for {given}")
    find_training(args.agent)
    names = [field.name for field in dataclasses.fields(TrainingOptions)]
    options = TrainingOptions(**{name: getattr(args, name) for name in names})

    from rl.trainers import find_trainer
    from twin.estimation.active_model import ActiveModel
    from twin.evaluation.reading import true_records
    from twin.hysteresis import load_model

    active_model = ActiveModel(
        load_model(args.model), args.sample_time, measurement_variance=args.noise_level
    )
    records = true_records(args.data, args.sample_time)
    folder = output_folder(args.out)
    trainer = find_trainer(args.agent)
    progress = TrainingProgress(f"train {args.agent}", trainer.unit)
    path = trainer.train(records, active_model, options, folder, progress)
    return Summary(
        f"{path}: {args.agent} trained on {len(records)} records", {"out": str(path), "agent": args.agent}
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Train, train, argv)


if __name__ == "__main__":
    sys.exit(main())
