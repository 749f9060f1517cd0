"""`endotwin evaluate`: compare all methods under noise, as in the paper, or far beyond it."""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from rl.learned import PAPER_SAMPLE_TIME
from rl.lstm import Lstm, LstmEstimator, load_lstm, train_lstm
from rl.methods import oracle_method, policy_method
from rl.policy import Policy, load_policy
from rl.supervised import SequenceTraining
from rl.training import Training, train_policy
from scripts.command import Progress, Summary, TrainingProgress, output_folder, run_verb
from scripts.full_suite import SAMPLE_TIMES, FullSuite, run_full_suite
from twin.estimation.active_model import ActiveModel
from twin.estimation.open_loop import OpenLoop
from twin.estimation.task import TrainingTask, stack_records
from twin.estimation.tuning import draw_training_episodes, tune_active_model, tune_constant_gain
from twin.evaluation.compare import evaluate as compare
from twin.evaluation.method import Method, as_method
from twin.evaluation.protocol import Protocol
from twin.evaluation.reading import evaluation_records, true_records
from twin.evaluation.track import save_tracks
from twin.files.atomic import write_whole
from twin.hysteresis import ColemanHodgdon, load_model
from twin.report.figures import rmse_figure, to_png_bytes
from twin.report.paper_figures import paper_figures
from twin.report.tables import paper_tables

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Evaluate:
    """Compare methods on test records under noise.

    The suite `paper` has C-H, AM, LSTM, direct RL and RAM, and two yardsticks. A learned method that is not
    given is trained on --train and kept beside the results; without --train it is left out.

    The suite `full` has every estimator here, ten noises, two sample times and the limit, an ensemble of
    twins. It makes what it is not given: records, models, training. All is kept; a stopped run goes on.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Test set: folders of MCAP files, or files. The full suite simulates its own without them."""
    out: Path
    """Folder for evaluation.json, tables, figures and tracks."""
    model: Path = Path("coleman_hodgdon.json")
    """Reference model, as `endotwin identify` writes it. The full suite identifies its own."""
    train: Path | None = None
    """Training set, to train what is not given and to tune the yardsticks."""
    policy: tuple[Path, ...] = ()
    """policy.onnx of trained policies (RAM, direct RL)."""
    lstm: Path | None = None
    """lstm.pt of a trained LSTM."""
    suite: str = "paper"
    """paper: its five noises, and the Poisson ones with dither beside them; paper-only: its five; full."""
    seeds: int = 20
    """Draws of the noise."""
    sample_time: tuple[float, ...] = ()
    """T [s]; records are thinned to it. Without it, 0.1, and in the full suite 0.1 and 0.02."""
    initial_error_deg: float = 20.0
    """How far the initial estimate is off [deg]."""
    episodes: int = Training.episodes
    """Episodes of PPO for a policy that is not given (full suite: at T = 0.1; as many samples at others)."""
    preset: str = "ureteroscope"
    """Full suite: the twin of records and ensembles, and the ranges that they are drawn from."""
    members: int = 256
    """Full suite: twins in an ensemble."""
    seconds: float = 60.0
    """Full suite: length of the records that it simulates."""
    workers: int = 0
    """Full suite: processes; 0 for one per core. The results do not depend on it."""
    seed: int = 0
    json: bool = False
    """Print the summary as one JSON object."""


def evaluate(args: Evaluate) -> Summary:
    """Write `evaluation.json`, tables, figures and `tracks.npz`."""
    if args.suite == "full":
        return _full(args)
    return _paper(args)


def _full(args: Evaluate) -> Summary:
    if args.policy or args.lstm:
        raise ValueError(
            "--suite full trains every method at each of its sample times: give no --policy or --lstm"
        )
    Protocol("full", args.seeds, PAPER_SAMPLE_TIME, args.initial_error_deg, args.seed)
    if args.episodes < 1 or args.workers < 0:
        raise ValueError(f"--episodes {args.episodes}, --workers {args.workers}: at least 1 and 0")
    suite = FullSuite(
        folder=output_folder(args.out),
        data=args.data,
        train=args.train,
        preset=args.preset,
        sample_times=tuple(sorted(args.sample_time or SAMPLE_TIMES, reverse=True)),
        seeds=args.seeds,
        initial_error_deg=args.initial_error_deg,
        episodes=args.episodes,
        members=args.members,
        seconds=args.seconds,
        workers=args.workers,
        seed=args.seed,
    )
    return run_full_suite(suite)


def _paper(args: Evaluate) -> Summary:
    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    if len(args.sample_time) > 1:
        raise ValueError("--sample-time: only the full suite takes more than one")
    T = args.sample_time[0] if args.sample_time else PAPER_SAMPLE_TIME
    protocol = Protocol(args.suite, args.seeds, T, args.initial_error_deg, args.seed)
    model = load_model(args.model)
    if not isinstance(model, ColemanHodgdon):
        raise ValueError(f"--model {args.model} is {model.name}: the paper's suite rests on coleman-hodgdon")
    active_model = ActiveModel(model, T)
    test = evaluation_records(args.data, T)
    training = true_records([args.train], T) if args.train else None
    policies = _load_policies(args.policy, active_model)
    network = load_lstm(args.lstm) if args.lstm else None
    if network is not None:
        _check_sample_time("LSTM", float(network.sample_time), T)
    folder = output_folder(args.out)

    if training:
        policies |= _train_missing(policies, training, active_model, args)
        network = network or _train_lstm(training, active_model, args)
    methods = _methods(active_model, policies, network, training, args.seed)
    rows, tracks = compare(test, methods, protocol, Progress("evaluate", "group"))

    tables = paper_tables(rows, "plain")
    contents = {"protocol": _describe(args, protocol, active_model, len(test)), "rows": rows}
    write_whole(folder / "evaluation.json", json.dumps(contents, indent=2, allow_nan=False) + "\n")
    write_whole(folder / "tables.md", paper_tables(rows, "markdown"))
    write_whole(folder / "rmse.png", to_png_bytes(rmse_figure(rows)))
    for number, (figure, _) in paper_figures(tracks, rows).items():
        write_whole(folder / f"figure_{number:02d}.png", to_png_bytes(figure))
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
    methods = [as_method("C-H", OpenLoop(active_model.model)), as_method("AM", active_model)]
    if network is not None:
        methods.append(as_method("LSTM", LstmEstimator(network)))
    methods += [policy_method(policies[name], active_model) for name in ("direct", "ram") if name in policies]
    if training:
        task = TrainingTask(*stack_records(training))
        episodes = draw_training_episodes(task, seed)
        tuned = tune_active_model(
            active_model, episodes.pull_mm, episodes.measurement_deg, episodes.initial_bend_deg
        )
        methods.append(as_method("AM-tuned", tuned))
        methods.append(as_method("Constant gain", tune_constant_gain(active_model, task, seed)))
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
        SequenceTraining(seed=args.seed),
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
