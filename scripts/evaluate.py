"""`endotwin evaluate`: compare all methods under noise, as the paper's Tables II and III."""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from rl.lstm import Lstm, LstmTraining, load_lstm, train_lstm
from rl.methods import (
    active_model_method,
    coleman_hodgdon_method,
    constant_gain_method,
    lstm_method,
    oracle_method,
    policy_method,
    tuned_active_model_method,
)
from rl.policy import Policy, load_policy
from rl.training import Training, train_policy
from scripts.command import Progress, Summary, TrainingProgress, output_folder, run_verb
from scripts.records import true_records
from twin.estimation.active_model import ActiveModel
from twin.evaluation import Method, Protocol
from twin.evaluation import evaluate as compare
from twin.figures import rmse_figure, to_png_bytes
from twin.hysteresis import load_model
from twin.recording.atomic import write_whole
from twin.tables import paper_tables
from twin.track import save_tracks

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Evaluate:
    """Compare C-H, AM, LSTM, direct RL and RAM, and two yardsticks, on test records under noise.

    A learned method that is not given is trained on --train and kept beside the results; without --train it
    is left out.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Test set: folders of MCAP files, or files."""
    out: Path
    """Folder for evaluation.json, tables, figures and tracks."""
    model: Path = Path("coleman_hodgdon.json")
    """Reference model, as `endotwin identify` writes it."""
    train: Path | None = None
    """Training set, to train what is not given and to tune the yardsticks."""
    policy: tuple[Path, ...] = ()
    """policy.onnx of trained policies (RAM, direct RL)."""
    lstm: Path | None = None
    """lstm.pt of a trained LSTM."""
    suite: str = "paper"
    """paper: its five noises, and the Poisson ones with dither beside them; paper-only: its five."""
    seeds: int = 20
    """Draws of the noise."""
    sample_time: float = 0.1
    """T [s]; records are thinned to it."""
    initial_error_deg: float = 20.0
    """How far the initial estimate is off [deg]."""
    episodes: int = Training.episodes
    """Episodes of PPO for a policy that is not given."""
    seed: int = 0
    json: bool = False
    """Print the summary as one JSON object."""


def evaluate(args: Evaluate) -> Summary:
    """Write `evaluation.json`, `tables.md`, `rmse.png` and `tracks.npz`."""
    protocol = Protocol(args.suite, args.seeds, args.sample_time, args.initial_error_deg, args.seed)
    active_model = ActiveModel(load_model(args.model), args.sample_time)
    test = true_records(args.data, args.sample_time)
    training = true_records([args.train], args.sample_time) if args.train else None
    policies = _load_policies(args.policy, active_model)
    network = load_lstm(args.lstm) if args.lstm else None
    if network is not None:
        _check_sample_time("LSTM", float(network.sample_time), args.sample_time)
    folder = output_folder(args.out)

    if training:
        policies |= _train_missing(policies, training, active_model, args)
        network = network or _train_lstm(training, active_model, args)
    methods = _methods(active_model, policies, network, training, args.seed)
    rows, tracks = compare(test, methods, protocol, Progress("evaluate", "noise"))

    tables = paper_tables(rows, "plain")
    contents = {"protocol": _describe(args, protocol, active_model, len(test)), "rows": rows}
    write_whole(folder / "evaluation.json", json.dumps(contents, indent=2, allow_nan=False) + "\n")
    write_whole(folder / "tables.md", paper_tables(rows, "markdown"))
    write_whole(folder / "rmse.png", to_png_bytes(rmse_figure(rows)))
    save_tracks(folder / "tracks.npz", tracks)
    print(tables, file=sys.stderr if args.json else sys.stdout)
    line = f"{folder}/evaluation.json: {len(methods)} methods, {len(test)} records, {args.seeds} noise seeds"
    summary = {"out": str(folder / "evaluation.json"), "methods": [method.name for method in methods]}
    return Summary(line, summary)


def _methods(
    active_model: ActiveModel,
    policies: dict[str, Policy],
    network: Lstm | None,
    training: list[tuple[Array, Array]] | None,
    seed: int,
) -> list[Method]:
    methods = [coleman_hodgdon_method(active_model), active_model_method(active_model)]
    if network is not None:
        methods.append(lstm_method(network))
    methods += [policy_method(policies[name], active_model) for name in ("direct", "ram") if name in policies]
    if training:
        methods.append(tuned_active_model_method(active_model, training, seed))
        methods.append(constant_gain_method(active_model, training, seed))
    if "ram" in policies:
        methods.append(oracle_method(policies["ram"], active_model))
    return methods


def _train_missing(
    policies: dict[str, Policy],
    training: list[tuple[Array, Array]],
    active_model: ActiveModel,
    args: Evaluate,
) -> dict[str, Policy]:
    trained = {}
    for agent in ("ram", "direct"):
        if agent not in policies:
            path = train_policy(
                training,
                active_model,
                Training(agent=agent, episodes=args.episodes, seed=args.seed),
                args.out / agent,
                TrainingProgress(f"train {agent}", "samples"),
            )
            trained[agent] = load_policy(path)
    return trained


def _train_lstm(training: list[tuple[Array, Array]], active_model: ActiveModel, args: Evaluate) -> Lstm:
    return train_lstm(
        training,
        active_model,
        LstmTraining(seed=args.seed),
        args.out / "lstm",
        TrainingProgress("train lstm", "steps"),
    )


def _load_policies(paths: Sequence[Path], active_model: ActiveModel) -> dict[str, Policy]:
    """Load policies by agent, and refuse one that was trained for something else than what is evaluated.

    Raises:
        ValueError: two of one agent, another sample time, or RAM trained beside another filter.
    """
    policies: dict[str, Policy] = {}
    for path in paths:
        policy = load_policy(path)
        name = policy.agent_name
        if name in policies:
            raise ValueError(f"--policy {path}: a second policy of the agent {name!r}")
        _check_sample_time(f"{name} policy", policy.active_model.sample_time, active_model.sample_time)
        trained = dataclasses.replace(
            policy.active_model, measurement_variance=active_model.measurement_variance
        )
        if name == "ram" and trained != active_model:
            raise ValueError(f"--policy {path} was trained beside another model or filter than --model says")
        policies[name] = policy
    return policies


def _check_sample_time(what: str, trained: float, sample_time: float) -> None:
    if abs(trained - sample_time) > 1e-9:
        raise ValueError(f"the {what} was trained at T = {trained:g} s, not at {sample_time:g} s")


def _describe(args: Evaluate, protocol: Protocol, active_model: ActiveModel, records: int) -> dict:
    return {
        **dataclasses.asdict(protocol),
        "records": records,
        "phi": "measured innovation; rows with oracle = true use the clean truth instead",
        "filters_told": "the variance of the noise as R",
        "process_variance": list(active_model.process_variance),
        "initial_variance": list(active_model.initial_variance),
        "model": str(args.model),
        "policies": [str(path) for path in args.policy],
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Evaluate, evaluate, argv)


if __name__ == "__main__":
    sys.exit(main())
