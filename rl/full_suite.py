"""The full benchmark, end to end: records, fits, training, limit, scores, tables and figures.

Every stage keeps what it made beside the results; a run that was stopped goes on from there.
"""

import dataclasses
import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rl.options import TrainingOptions
from rl.trainers import Trainer, find_trainer
from twin import __version__
from twin.dataset.recipe import Recipe
from twin.dataset.write import write_dataset
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, method_specs, trainable_specs
from twin.estimation.set_membership import SetMembershipFilter
from twin.evaluation.compare import evaluate
from twin.evaluation.method import build_method
from twin.evaluation.protocol import SUITES, Protocol
from twin.evaluation.reading import evaluation_records, read_episodes, true_records, whole_pieces
from twin.evaluation.record import EvaluationRecord
from twin.evaluation.score import Score, to_rows
from twin.evaluation.track import Track, save_tracks
from twin.files.atomic import write_whole
from twin.files.run_folder import claim_folder
from twin.preset import Preset, Ranges, load_preset, load_ranges
from twin.report.summary import benchmark_figures, benchmark_tables
from twin.suite.fitting import identify_models, load_fits, needed_fits, save_fits
from twin.suite.intervals import containment
from twin.suite.limit import bounds, make_ensembles
from twin.suite.scenarios import SAMPLE_TIME, write_scenarios
from twin.workers.processes import local_workers

Array = NDArray[np.float64]
OnProgress = Callable[[int, int], None]
NewProgress = Callable[[str, str], OnProgress]
"""Begins to show the progress of a named stage, counted in some unit."""

SAMPLE_TIMES = (0.1, 0.02)
PAPER_SAMPLE_TIME = 0.1  # at which the number of episodes is meant [s]
TRAINING_STROKE_MM = (2.0, 4.0)  # the paper's


@dataclasses.dataclass(frozen=True)
class FullSuite:
    """Everything that the benchmark is run on.

    Attributes:
        folder: where all of it is kept.
        data: test records; without them, the benchmark's own are simulated.
        train: training records; without them, five on the paper's stroke are simulated.
        methods: names of the methods to compare; all, if empty.
        preset: nominal twin of records and ensembles, and ranges that they are drawn from.
        sample_times: T, each a multiple of 0.02 [s].
        seeds: draws of the noise.
        initial_error_deg: how far the initial estimate is off [deg].
        episodes: of PPO at T = 0.1 s; at another T as many samples.
        members: twins in an ensemble.
        seconds: length of the records that it simulates.
        workers: processes.
        seed: of everything that is drawn.
    """

    folder: Path
    data: tuple[Path, ...] = ()
    train: Path | None = None
    methods: tuple[str, ...] = ()
    preset: str = "ureteroscope"
    sample_times: tuple[float, ...] = SAMPLE_TIMES
    seeds: int = 20
    initial_error_deg: float = 20.0
    episodes: int = TrainingOptions.episodes
    members: int = 256
    seconds: float = 60.0
    workers: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what would fail after hours.

        Raises:
            ValueError: a number is out of range.
        """
        for T in self.sample_times:
            self.protocol(T)
            if T < SAMPLE_TIME or abs(T / SAMPLE_TIME - round(T / SAMPLE_TIME)) > 1e-9:
                raise InputError(f"sample_time = {T:g} s: must be a multiple of {SAMPLE_TIME:g} s")
        if self.members < 8:
            raise InputError(f"members = {self.members}: an ensemble needs at least 8")
        if self.seconds < 5:
            raise InputError(f"seconds = {self.seconds:g}: must be at least 5")
        if self.episodes < 1 or self.workers < 1:
            raise InputError(f"episodes = {self.episodes}, workers = {self.workers}: at least 1 each")
        if self.train and self.train.resolve() in {path.resolve() for path in self.data}:
            raise InputError(
                f"training set {self.train} is test data too: what is trained there proves nothing"
            )
        names = [spec.name for spec in method_specs()]
        for name in self.methods:
            if name not in names:
                raise InputError(f"unknown method {name!r}; valid: {', '.join(names)}")

    @property
    def specs(self) -> list[MethodSpec]:
        """Methods that are compared, in the order of tables."""
        return [spec for spec in method_specs() if not self.methods or spec.name in self.methods]

    def protocol(self, sample_time: float) -> Protocol:
        """Return how methods are compared at one sample time."""
        return Protocol("full", self.seeds, sample_time, self.initial_error_deg, self.seed)

    def folder_at(self, sample_time: float) -> Path:
        """Return where all that is made for one sample time is kept."""
        return self.folder / f"T_{sample_time:g}"


@dataclasses.dataclass(frozen=True)
class FullResult:
    """Results of the benchmark.

    Attributes:
        scores: of every method.
        records: number of test records.
        path: of `evaluation.json`.
    """

    scores: list[Score]
    records: int
    path: Path


def run_full_suite(suite: FullSuite, progress: NewProgress) -> FullResult:
    """Write `evaluation.json`, `benchmark.md`, figures and tracks.

    Args:
        suite: what to run.
        progress: begins to show the progress of a stage.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: records do not fit, or the folder holds another benchmark.
    """
    preset, ranges = load_preset(suite.preset), load_ranges(suite.preset)
    for path, T in ((path, T) for path in suite.data for T in (SAMPLE_TIME, *suite.sample_times)):
        evaluation_records([path], T)  # a mistake is told now, not after the training
    if suite.train:
        true_records([suite.train], max(suite.sample_times))
    suite.folder.mkdir(parents=True, exist_ok=True)
    _claim(suite, preset, ranges)
    with local_workers(suite.workers) as executor:
        data = suite.data
        if not data:
            done = progress("test records", "ep")
            data = tuple(write_scenarios(suite.folder / "records", preset, ranges, suite.seconds, suite.seed))
            done(len(data), len(data))
        train = suite.train or _training_records(suite, preset, executor, progress)
        known = [_learn(suite, train, T, preset, ranges, executor, progress) for T in suite.sample_times]
        _train(suite, known, executor, progress)
        ensembles = _ensembles(suite, data, preset, ranges, progress)
        scores: list[Score] = []
        limits: list[dict[str, Any]] = []
        sets: list[dict[str, Any]] = []
        tracks: list[list[Track]] = []
        records: list[EvaluationRecord] = []
        for knowledge in known:
            T = knowledge.sample_time
            records = evaluation_records(data, T)
            knowledge = dataclasses.replace(knowledge, ensembles=ensembles)
            methods = [build_method(spec, knowledge) for spec in suite.specs]
            shown = progress(f"evaluate T = {T:g} s", "group")
            found, seen = evaluate(records, methods, suite.protocol(T), shown, executor)
            scores += found
            if ensembles:
                limits += bounds(records, list(ensembles), T, SUITES["full"])
            sets += containment(records, _bounded(suite, knowledge), suite.protocol(T))
            tracks.append(seen)
    return _write(suite, scores, limits, sets, tracks[0], records)


def _claim(suite: FullSuite, preset: Preset, ranges: Ranges) -> None:
    """Refuse a folder whose records, fits and networks were made from something else.

    Raises:
        ValueError: they were.
    """
    given = None
    if suite.train:
        records = true_records([suite.train], SAMPLE_TIME)
        given = {"path": str(suite.train), "mean_bend_deg": [float(bend.mean()) for _, bend in records]}
    configuration = {
        "endotwin": __version__,
        "preset": preset.to_dict(),
        "ranges": ranges.to_dict(),
        "train": given,
        "simulated": None if suite.data and suite.train else suite.seconds,
        "episodes": suite.episodes,
        "seed": suite.seed,
    }
    claim_folder(suite.folder, json.loads(json.dumps(configuration)))


def _training_records(suite: FullSuite, preset: Preset, executor: Executor, progress: NewProgress) -> Path:
    """Simulate five records on the paper's training stroke, one of each kind of signal."""
    folder = suite.folder / "train"
    if not (folder / "dataset.json").is_file():
        recipe = Recipe(preset, (TRAINING_STROKE_MM,), seconds=suite.seconds, seeds=(suite.seed,))
        shown = progress("training records", "ep")
        write_dataset(recipe, folder, executor, workers=suite.workers, on_progress=shown)
    return folder


def _learn(
    suite: FullSuite,
    train: Path,
    T: float,
    preset: Preset,
    ranges: Ranges,
    executor: Executor,
    progress: NewProgress,
) -> Knowledge:
    """Identify the models and find the fits on the training records, or read what is kept."""
    folder = suite.folder_at(T)
    folder.mkdir(parents=True, exist_ok=True)
    measured = [piece for episode in read_episodes([train], T) for piece in whole_pieces(episode)]
    models = identify_models(measured, folder, suite.seed, progress(f"identify T = {T:g} s", "model"))
    path = folder / "tuned.json"
    knowledge = Knowledge(
        sample_time=T,
        models=models,
        records=true_records([train], T),
        seed=suite.seed,
        fits=load_fits(path),
        smallest_wire_offset=ranges.lowest("wire_offset", preset),
    )
    missing = [fit for fit in needed_fits(suite.specs) if fit.key not in knowledge.fits]
    if missing:
        jobs = {fit.key: executor.submit(fit.find, knowledge) for fit in missing}
        _wait(list(jobs.values()), progress(f"tune T = {T:g} s", "filter"))
        fits = {**knowledge.fits, **{key: job.result() for key, job in jobs.items()}}
        save_fits(path, fits)
        knowledge = dataclasses.replace(knowledge, fits=fits)
    trained = {
        agent: folder / agent / spec.training.file
        for agent, spec in trainable_specs().items()
        if spec.training and agent in _agents(suite)
    }
    return dataclasses.replace(knowledge, trained=trained)


def _agents(suite: FullSuite) -> list[str]:
    """Agents that the compared methods run on, each once."""
    return list(dict.fromkeys(spec.agent for spec in suite.specs if spec.agent is not None))


def _train(suite: FullSuite, known: Sequence[Knowledge], executor: Executor, progress: NewProgress) -> None:
    """Train every learned method at every sample time, on as many samples at each."""
    # PPO takes longest: what begins last would leave the other workers idle.
    agents = sorted(_agents(suite), key=lambda agent: not find_trainer(agent).counts_samples)
    jobs = [
        executor.submit(train_one, agent, knowledge, suite.episodes, suite.seed)
        for agent in agents
        for knowledge in known
    ]
    if jobs:
        _wait(jobs, progress("train", "method"))


def train_one(agent: str, knowledge: Knowledge, episodes: int, seed: int) -> None:
    """Train one method under the strict protocol; a finished one is left as it is. It runs in a worker."""
    trainer = find_trainer(agent)
    active_model = ActiveModel(knowledge.reference, knowledge.sample_time)
    count = episodes_at(trainer, episodes, knowledge.sample_time)
    options = TrainingOptions(agent=agent, episodes=count, seed=seed)
    trainer.train(knowledge.records, active_model, options, knowledge.trained[agent].parent, None)


def episodes_at(trainer: Trainer, episodes: int, sample_time: float) -> int:
    """Return the episodes that are as many samples at a sample time [s] as some are at the paper's."""
    share = sample_time / PAPER_SAMPLE_TIME if trainer.counts_samples else 1.0
    return max(round(episodes * share), 1)


def _ensembles(
    suite: FullSuite, data: Sequence[Path], preset: Preset, ranges: Ranges, progress: NewProgress
) -> tuple[Path, ...]:
    """Simulate ensembles along the commands of the test, where a method needs them."""
    if not any(spec.ensembles for spec in suite.specs):
        return ()
    pulls = {episode.pull.tobytes(): episode.pull for episode in read_episodes(data, SAMPLE_TIME)}
    return tuple(
        make_ensembles(
            preset,
            ranges,
            list(pulls.values()),
            suite.folder / "ensembles",
            count=suite.members,
            seed=suite.seed,
            on_progress=progress("ensembles", "command"),
        )
    )


def _bounded(suite: FullSuite, knowledge: Knowledge) -> dict[str, SetMembershipFilter]:
    """Filters that state an interval, by name."""
    built = {spec.name: spec.build(knowledge) for spec in suite.specs if "set" in spec.family}
    return {name: filter_ for name, filter_ in built.items() if isinstance(filter_, SetMembershipFilter)}


def _wait(futures: Sequence[Any], progress: OnProgress) -> None:
    progress(0, len(futures))
    for done, future in enumerate(as_completed(futures), start=1):
        future.result()
        progress(done, len(futures))


def _write(
    suite: FullSuite,
    scores: list[Score],
    limits: list[dict[str, Any]],
    sets: list[dict[str, Any]],
    tracks: Sequence[Track],
    records: Sequence[EvaluationRecord],
) -> FullResult:
    folder = suite.folder
    protocol = {
        "suite": "full",
        "seeds": suite.seeds,
        "initial_error_deg": suite.initial_error_deg,
        "seed": suite.seed,
        "sample_times_s": list(suite.sample_times),
        "preset": suite.preset,
        "records": len(records),
        "members": suite.members,
        "episodes": suite.episodes,
        "data": [str(path) for path in suite.data],
        "train": str(suite.train or folder / "train"),
        "phi": "measured innovation; rows with oracle = true use the clean truth instead",
        "told": {spec.name: spec.told for spec in suite.specs},
    }
    contents = {"protocol": protocol, "rows": to_rows(scores), "bounds": limits, "intervals": sets}
    out = folder / "evaluation.json"
    write_whole(out, json.dumps(contents, indent=2, allow_nan=False) + "\n")
    write_whole(folder / "benchmark.md", benchmark_tables(scores, limits, sets))
    for name, picture in benchmark_figures(scores, tracks).items():
        write_whole(folder / name, picture)
    save_tracks(folder / "tracks.npz", tracks)
    return FullResult(scores, len(records), out)


def all_cores() -> int:
    """Return how many workers there are unless somebody says."""
    return os.cpu_count() or 1
