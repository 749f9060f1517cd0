"""`endotwin train`: train a policy, RAM or direct RL, or another learned filter, on records."""

import contextlib
import dataclasses
import sys
from collections.abc import Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from rl.options import TrainingOptions
from scripts.command import Options, Summary, compile_once, run_verb
from scripts.outputs import output_folder
from scripts.progress import TrainingProgress
from twin.estimation.registry import find_training, trainings

if TYPE_CHECKING:
    from rl.trainers import Material, OnProgress

STRICT = {"noise": "gaussian", "noise_level": 0.1}
_OPTIONS = [field.name for field in dataclasses.fields(TrainingOptions)]
_OF_TWINS = ("preset", "noises", "stroke", "sample_times")
_OF_RECORDS = {"sample_time", *_OPTIONS} - {"agent", "episodes", "seed"}
POLICIES = ("ram", "direct")  # agents that learn by reinforcement on records
_OF_POLICIES = ("agent_file", "algorithm", "network", "error_scale", "held_out")


def agents_in_words(default: str = "") -> str:
    """Return the agents, each with its purpose, for the help of the command line."""
    return "; ".join(f"{agent}: {training.purpose}" for agent, training in trainings().items())


@dataclasses.dataclass(frozen=True)
class Train(Options):
    """Train a learned estimator on records, or on simulated twins; a stopped run of a policy continues.

    Defaults are the paper's: RAM by PPO on records, with Table I. A finished run of PPO continues if
    --episodes is larger.

    Examples:
        endotwin train data/train --model coleman_hodgdon.json --agent ram --episodes 2000 --out runs/paper
        endotwin train --agent ram --protocol twins --preset ureteroscope --seed 1 --out runs/ram_twins
    """

    GROUPS: ClassVar = {
        "Protocol twins": "preset",
        "Protocols strict and free": "sample_time",
        "Policies ram and direct, trained on records": "algorithm",
        "Several trainings": "seeds",
    }

    out: Path
    """Run folder: policy.onnx or the network's file, config.yaml, progress.csv."""
    data: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Folders of MCAP files, or files; none for --protocol twins."""
    model: Path | None = None
    """coleman_hodgdon.json of the reference model; none for --protocol twins."""
    agent: Annotated[str, tyro.conf.arg(help_behavior_hint=agents_in_words)] = TrainingOptions().agent
    """Learned method."""
    protocol: Literal["strict", "free", "twins"] = "strict"
    """strict: on records under Gaussian noise of R = 0.1 alone, as in the paper; free: under --noise; twins:
    on simulated twins of --preset under noises of every kind, for any sample time."""
    episodes: int = TrainingOptions.episodes
    """Episodes of PPO in total; the steps of a network scale with them."""
    tensorboard: bool = False
    """Also write the learning curve for TensorBoard, into OUT/tensorboard (extra `tensorboard`)."""
    preset: str = "ureteroscope"
    """Endoscope, and the ranges that its twins are drawn from; a name or a YAML file."""
    noises: tuple[str, ...] = ()
    """Families of noise to learn from, of those in docs/ram_twins.md; all, if not given."""
    stroke: tuple[float, float] | None = None
    """Lowest and highest pulling distance of the training [mm]; -4 4, if not given."""
    sample_times: tuple[float, ...] = ()
    """Sample times of the training [s], of 0.1, 0.04 and 0.02, the first of several in 0.7 of the sequences;
    all three in this order, if not given."""
    sample_time: float = 0.1
    """T [s]; records are thinned to it."""
    held_out: Path | None = None
    """Recordings that are not trained on: the learning curve also shows the mean reward on them."""
    noise: str = TrainingOptions.noise
    """Measurement noise during training (protocol free)."""
    noise_level: float = TrainingOptions.noise_level
    """Its level [deg^2 or deg] (protocol free)."""
    initial_error_deg: float = TrainingOptions.initial_error_deg
    """Largest error of the initial estimate [deg]."""
    error_scale: float = TrainingOptions.error_scale
    """PPO trains on each record as it is, and with its departure from the model scaled down to this share, so
    that it learns to handle noise larger than the model's error; 1: only as it is."""
    algorithm: Literal["ppo", "sac", "td3"] = "ppo"
    """Reinforcement learning algorithm."""
    network: tuple[int, ...] = TrainingOptions.network
    """Units of each layer of the policy."""
    agent_file: Path | None = None
    """Your Python file, which is executed: make_agent(environment, seed) returns an algorithm of
    stable-baselines3 or sb3-contrib, or a module of torch; wrap(environment), if it exists, wraps the
    environment, that of --agent ram or direct."""
    learning_rate: float = TrainingOptions.learning_rate
    """Learning rate of PPO."""
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
    reward_scale: float = TrainingOptions.reward_scale
    """Factor on the reward, eq. 11."""
    seed: int = 0
    """Seed of the network, the exploration and the noise."""
    seeds: int | None = None
    """Number of trainings, with --seed and the seeds after it, each in a folder OUT/seed_N; `evaluate` takes
    their files as one row."""
    workers: int = 0
    """Processes; 0 for one per core. The files do not depend on it."""
    search: bool = False
    """With --protocol twins: first try some learning rates and sizes of the network, each a quarter as long,
    on other twins, and train with the best. OUT/search keeps the trials."""
    dask: str | None = None
    """Dask scheduler whose workers train; they need --out under the same path."""


def train(args: Train) -> Summary:
    """Fill a run folder."""
    noise = {name: getattr(args, name) for name in STRICT}
    if args.protocol == "strict" and noise != STRICT:
        strict, other = (
            "--noise {noise} --noise-level {noise_level:g}".format(**of) for of in (STRICT, noise)
        )
        raise ValueError(f"--protocol strict trains under {strict}: use --protocol free for {other}")
    agent = _agent(args)
    if agent not in POLICIES and (flag := _first_given(args, _OF_POLICIES)):
        raise ValueError(f"{flag} is for the agents {' and '.join(POLICIES)}, not for {agent}")
    given = {name: getattr(args, name) for name in _OPTIONS}
    paths = {name: str(getattr(args, name) or "") for name in ("agent_file", "held_out")}
    options = TrainingOptions(**given | {"agent": agent} | paths)

    if args.seeds is None and (args.workers or args.dask is not None or args.search):
        raise ValueError("--workers, --dask and --search are for several trainings: give --seeds")
    if args.search and args.protocol != "twins":
        raise ValueError("--search is for --protocol twins")

    from rl.trainers import find_trainer

    material, source = _on_twins(args) if find_training(agent).on_twins else _on_records(args)
    if args.seeds is not None:
        return _train_seeds(args, args.seeds, material, options, source)
    trainer = find_trainer(agent)
    progress = TrainingProgress(f"train {agent}", trainer.unit)
    folder = output_folder(args.out)
    before = _Before([folder], agent)
    with _followed([folder], args, progress) as on_progress:
        path = trainer.run(material, options, folder, on_progress)
    what = f"{agent} with {args.agent_file.name}" if args.agent_file else agent
    line = f"{path}: {what} trained on {source}{before.in_words()}"
    return Summary(line, {"out": str(path), "agent": agent})


def _train_seeds(
    args: Train, count: int, material: "Material", options: TrainingOptions, source: str
) -> Summary:
    from rl.sweep import FOLDER as SEARCH_FOLDER
    from rl.sweep import (
        folder_of,
        grid_of,
        search_settings,
        seeds_from,
        train_seeds,
        trials_table,
        with_settings,
    )
    from twin.workers.processes import choose_workers, shared_table

    seeds = seeds_from(args.seed, count)
    if find_training(options.agent).on_twins:
        compile_once("endotwin train")
    table = ""
    with contextlib.ExitStack() as stack:
        folder = output_folder(args.out)
        folders = [folder_of(folder, seed) for seed in seeds]
        before = _Before(folders, options.agent)
        grid = grid_of(options.agent) if args.search else []
        executor, _ = stack.enter_context(choose_workers(max(count, len(grid)), args.workers, args.dask))
        shares = stack.enter_context(shared_table()) if args.dask is None else None
        if grid:
            progress = TrainingProgress(f"search {options.agent}, {len(grid)} settings", "thousandths")
            trials = search_settings(material, options, folder / SEARCH_FOLDER, executor, progress, shares)
            material = with_settings(material, trials[0].settings)
            table = trials_table(trials)
        progress = TrainingProgress(f"train {options.agent}, {count} seeds", "thousandths")
        on_progress = stack.enter_context(_followed(folders, args, progress))
        paths = train_seeds(material, options, seeds, folder, executor, on_progress, shares)
    which = f"seeds {seeds[0]} to {seeds[-1]}"
    line = f"{args.out}: {options.agent} trained on {source} with {which}{before.in_words()}"
    return Summary(line, {"out": [str(path) for path in paths], "agent": options.agent}, table=table)


@contextlib.contextmanager
def _followed(folders: Sequence[Path], args: Train, progress: TrainingProgress) -> "Iterator[OnProgress]":
    """Context manager: shows progress, and the curves in TensorBoard if that is asked for."""
    if not args.tensorboard:
        yield progress
        return
    from scripts.board import Board

    with contextlib.closing(Board(folders)) as board:

        def show(done: int, total: int, reward: float) -> None:
            progress(done, total, reward)
            board()  # from here on, the folder is known to be that of this run

        yield show


class _Before:
    """Runs as they were before a training: finished, stopped, or not begun."""

    def __init__(self, folders: Sequence[Path], agent: str):
        from twin.files.run_folder import CHECKPOINT_FILE

        self.files = {folder.name: folder / find_training(agent).file for folder in folders}
        self.written = {name: _written(file) for name, file in self.files.items()}
        self.stopped = {folder.name for folder in folders if (folder / CHECKPOINT_FILE).is_file()}

    def in_words(self) -> str:
        """Return, after the training, which of the runs existed before it."""
        parts: dict[str, list[str]] = {}
        for name, written in self.written.items():
            if written:
                same = _written(self.files[name]) == written
                parts.setdefault("finished before" if same else "went on from a shorter run", []).append(name)
            elif name in self.stopped:
                parts.setdefault("resumed from its checkpoint", []).append(name)
        if len(self.files) == 1:
            return "".join(f"; {word}" for word in parts)
        return "".join(f"; {word}: {', '.join(names)}" for word, names in parts.items())


def _written(path: Path) -> int:
    """Return the time at which a file was written [ns]; 0 if it does not exist."""
    return path.stat().st_mtime_ns if path.is_file() else 0


def _agent(args: Train) -> str:
    """Return the agent that is meant: with the protocol `twins`, the one that learns on twins."""
    known = trainings()
    if args.protocol != "twins":
        if find_training(args.agent).on_twins:
            raise ValueError(f"--agent {args.agent} is trained with --protocol twins")
        return args.agent
    on_twins = [agent for agent, training in known.items() if training.on_twins]
    for agent in (args.agent, f"{args.agent}-twins"):
        if agent in on_twins:
            return agent
    valid = ", ".join(agent.removesuffix("-twins") for agent in on_twins)
    raise ValueError(f"--agent {args.agent} is not trained on twins; valid with --protocol twins: {valid}")


def _first_given(args: Train, names: Collection[str]) -> str | None:
    """Return the flag of the first option that differs from its default; None if none does."""
    for field in dataclasses.fields(Train):
        if field.name in names and getattr(args, field.name) != field.default:
            return f"--{field.name.replace('_', '-')}"
    return None


def _on_twins(args: Train) -> "tuple[Material, str]":
    from rl.trainers import Material, Simulated
    from twin.preset import load_preset, load_ranges

    if args.data or args.model:
        raise ValueError("--protocol twins simulates what it is trained on: give no data and no --model")
    if flag := _first_given(args, _OF_RECORDS):
        raise ValueError(f"{flag} is of a training on records: --protocol twins has settings of its own")
    preset = load_preset(args.preset)
    names = ("noises", "stroke_mm", "sample_times")
    given = zip(names, (args.noises, args.stroke, args.sample_times), strict=True)
    settings = {name: value for name, value in given if value}
    simulated = Simulated(preset, load_ranges(args.preset), settings)
    return Material(simulated=simulated), f"simulated twins of {preset.name}"


def _on_records(args: Train) -> "tuple[Material, str]":
    from rl.trainers import Material
    from twin.estimation.active_model import ActiveModel
    from twin.evaluation.reading import true_records
    from twin.hysteresis import load_model

    if flag := _first_given(args, _OF_TWINS):
        raise ValueError(f"{flag} is for --protocol twins: a training on records has none")
    if not args.data or args.model is None:
        missing = "--model" if args.data else "folders of MCAP files"
        raise ValueError(f"--protocol {args.protocol} needs {missing}; --protocol twins simulates its own")
    active_model = ActiveModel(
        load_model(args.model), args.sample_time, measurement_variance=args.noise_level
    )
    records = true_records(args.data, args.sample_time)
    return Material(records, active_model), f"{len(records)} records"


main = partial(run_verb, Train, train)

if __name__ == "__main__":
    sys.exit(main())
