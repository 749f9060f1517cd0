"""The full comparison, end to end: records, fits, training runs, limit, scores, tables and figures.

Every stage keeps its files with the results; a run that was stopped continues from there.
"""

import dataclasses
import functools
import json
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any

from rl.comparison.paper import FIGURES, RESULTS
from rl.options import LIMITS, TRAINING_STROKE_MM, TrainingOptions
from rl.sweep import folder_of
from rl.trainers import Trainer, find_trainer, material_of
from twin import __version__
from twin.dataset.recipe import Recipe
from twin.dataset.write import write_dataset
from twin.episode import Record
from twin.errors import InputError
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import (
    MethodSpec,
    find_training,
    load_method_files,
    method_specs,
    needed_fits,
    trainings,
)
from twin.estimation.set_membership import SetMembershipFilter
from twin.evaluation.compare import Comparison, compare
from twin.evaluation.costs import Cost, method_costs
from twin.evaluation.fitting import identify_models, load_fits, save_fits
from twin.evaluation.method import build_method
from twin.evaluation.protocol import Protocol
from twin.evaluation.reading import complete_pieces, evaluation_records, read_episodes, true_records
from twin.evaluation.results import save_runs, save_tracks
from twin.evaluation.scenarios import (
    SAMPLE_TIME,
    name_of_test_set,
    scenarios,
    untrained_scenarios,
    write_scenarios,
)
from twin.evaluation.score import MOST_TRAININGS, Score, to_rows
from twin.evaluation.yardsticks import bounds, containment, make_ensembles
from twin.files.atomic import MADE_BY, write_whole
from twin.files.bounds import LONGEST_SECONDS, MOST_WORKERS, check_between
from twin.files.run_folder import claim_folder
from twin.preset import Preset, Ranges, load_preset, load_ranges
from twin.reduced.members import check_members
from twin.reduced.parameters import refuse_gravity
from twin.report.figures import comparison_figures
from twin.report.tables import comparison_tables, condition_pages, costs_csv, page_names, scores_csv
from twin.simulation import check_physics
from twin.workers.processes import choose_workers

OnProgress = Callable[[int, int], None]
NewProgress = Callable[[str, str], OnProgress]
"""Begins to show the progress of a named stage, counted in some unit."""

SAMPLE_TIMES = (0.1, 0.02)
PAPER_SAMPLE_TIME = 0.1
"""T that the number of episodes refers to [s]."""
EVERY = ("all",)
"""Value of `FullSuite.methods` for every method."""
MOST_MEMBERS, MOST_ENSEMBLES = 10_000, 100
RECORDS = {"full": ("records", scenarios), "untrained": ("records_untrained", untrained_scenarios)}
"""Folder of the records of each suite, and their drives."""


def full_files() -> dict[str, str]:
    """Return the files of the full suite, with a page for each condition, and their marks."""
    figures = ["rmse_by_noise.png", "times_the_limit.png", "ranks.png", "intervals.png", *FIGURES]
    tables = {"scores.csv": "method,oracle,noise", "costs.csv": "method,sample_us"}
    return RESULTS | tables | dict.fromkeys(["benchmark.md", *figures, *page_names()], MADE_BY)


@dataclasses.dataclass(frozen=True)
class FullSuite:
    """Settings of the full comparison.

    Attributes:
        folder: of all results and intermediate files.
        data: test records; without them, the suite's own are simulated.
        train: training records; without them, five on the paper's stroke are simulated.
        methods: names of the methods to compare; all but those on request, if empty; `EVERY` for those too.
        method_files: Python files whose methods are loaded here already, for the workers to load too.
        trained: trained files of each given agent, one for each training run; others are trained.
        preset: nominal twin of records and ensembles, and the ranges that they are drawn from.
        sample_times: T, each a multiple of 0.02 [s].
        seeds: draws of the noise.
        initial_error_deg: error of the initial estimate [deg].
        episodes: of PPO at T = 0.1 s; at another T as many samples.
        trainings: training runs of each learned method that is not given, with this seed and the following;
            its row is the mean over them.
        members: twins in an ensemble.
        ensembles: number of ensembles without a common twin; a row of one is the mean over them.
        member_physics: `reduced`, or `mujoco` as the records are.
        seconds: length of the simulated records.
        workers: processes.
        seed: of everything that is drawn.
        recorded_variance: R of recorded measurements, where they are used instead of drawn noise [deg^2].
        dask: address of a Dask scheduler, whose workers replace processes; they see the same paths.
        suite: `full`, or `untrained`: sensors and twins that no training meets.
        origin: command, versions and hashes of the data, for `evaluation.json`.
    """

    folder: Path
    data: tuple[Path, ...] = ()
    train: Path | None = None
    methods: tuple[str, ...] = ()
    method_files: tuple[Path, ...] = ()
    trained: dict[str, tuple[Path, ...]] = dataclasses.field(default_factory=dict)
    preset: str = "ureteroscope"
    sample_times: tuple[float, ...] = SAMPLE_TIMES
    seeds: int = 20
    initial_error_deg: float = 20.0
    episodes: int = TrainingOptions.episodes
    trainings: int = 1
    members: int = 256
    ensembles: int = 1
    member_physics: str = "reduced"
    seconds: float = 60.0
    workers: int = 1
    seed: int = 0
    recorded_variance: float | None = None
    dask: str | None = None
    suite: str = "full"
    origin: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse settings that would fail after hours."""
        for T in self.sample_times:
            self.protocol(T)
            if T < SAMPLE_TIME or abs(T / SAMPLE_TIME - round(T / SAMPLE_TIME)) > 1e-9:
                raise InputError(f"sample_time = {T:g} s: must be a multiple of {SAMPLE_TIME:g} s")
        if self.members < 8:
            raise InputError(f"members = {self.members}: an ensemble needs at least 8")
        check_between("members", self.members, 8, MOST_MEMBERS)
        check_between("ensembles", self.ensembles, 1, MOST_ENSEMBLES)
        check_physics(self.member_physics)
        check_between("seconds", self.seconds, 5, LONGEST_SECONDS, "s")
        check_between("episodes", self.episodes, *LIMITS["episodes"])
        check_between("trainings", self.trainings, 1, MOST_TRAININGS)
        check_between("workers", self.workers, 1, MOST_WORKERS)
        if self.train and os.path.realpath(self.train) in map(os.path.realpath, self.data):
            raise InputError(
                f"training set {self.train} is test data too: what is trained there proves nothing"
            )
        names = [spec.name for spec in method_specs()]
        for name in self.methods:
            if name not in names and self.methods != EVERY:
                raise InputError(f"unknown method {name!r}; valid: {', '.join(names)}")

    @property
    def specs(self) -> list[MethodSpec]:
        """Methods to compare, in the order of tables.

        The density of a recorded noise, or of a faulty sensor, is unknown.
        """
        if self.methods == EVERY:
            specs = method_specs()
        elif self.methods:
            specs = [spec for spec in method_specs() if spec.name in self.methods]
        else:
            specs = [
                spec
                for spec in method_specs()
                if not spec.presentation.on_request or spec.agent in self.trained
            ]
        no_density = self.recorded_variance is not None or self.suite != "full"
        return [spec for spec in specs if not (no_density and spec.needs_density)]

    @property
    def agents(self) -> list[str]:
        """Agents that the compared methods run on, each once."""
        return list(dict.fromkeys(spec.agent for spec in self.specs if spec.agent is not None))

    @property
    def agents_to_train(self) -> list[str]:
        """Agents whose files are not given."""
        return [agent for agent in self.agents if agent not in self.trained]

    def protocol(self, sample_time: float) -> Protocol:
        """Return the protocol at one sample time."""
        recorded = self.recorded_variance
        return Protocol(self.suite, self.seeds, sample_time, self.initial_error_deg, self.seed, recorded)


@dataclasses.dataclass(frozen=True)
class FullResult:
    """Results of the full comparison.

    Attributes:
        scores: of every method.
        records: number of test records.
        test_set: name of the published test set, where the records are that; else None.
        path: of `evaluation.json`.
    """

    scores: list[Score]
    records: int
    test_set: str | None
    path: Path


def run_full_suite(suite: FullSuite, progress: NewProgress) -> FullResult:
    """Run all stages and write `evaluation.json`, `benchmark.md`, figures, runs and tracks.

    Raises `FileNotFoundError` for a path that does not exist, and `ValueError` where records do not fit or
    the folder holds another comparison.
    """
    preset, ranges = load_preset(suite.preset), load_ranges(suite.preset)
    _refuse_mistakes(suite, preset)
    suite.folder.mkdir(parents=True, exist_ok=True)
    _claim(suite, preset, ranges)
    files = suite.method_files
    load_methods = functools.partial(load_method_files, files) if files else None
    with choose_workers(suite.workers, suite.workers, suite.dask, load_methods) as (executor, _):
        data = suite.data or _records(suite, preset, ranges, progress)
        train = suite.train or _training_records(suite, preset, executor, progress)
        known = [_learn(suite, train, T, preset, ranges, executor, progress) for T in suite.sample_times]
        _train_all(suite, known, executor, progress)
        ensembles = _ensembles_along(suite, data, preset, ranges, progress)
        found: list[Comparison] = []
        limits: list[dict[str, Any]] = []
        sets: list[dict[str, Any]] = []
        costs: dict[str, Cost] = {}
        records: list[Record] = []
        for knowledge in known:
            T = knowledge.sample_time
            records = evaluation_records(data, T)
            knowledge = dataclasses.replace(knowledge, ensembles=ensembles)
            methods = [build_method(spec, knowledge) for spec in suite.specs]
            trained = {spec.name: knowledge.trained[spec.agent] for spec in suite.specs if spec.agent}
            costs = costs or method_costs(methods, records[0], trained)
            shown = progress(f"evaluate T = {T:g} s", "group")
            found.append(compare(records, methods, suite.protocol(T), shown, executor))
            if ensembles:
                limits += bounds(records, list(ensembles[0]), T, suite.protocol(T).conditions)
            built = {
                spec.name: spec.build(knowledge) for spec in suite.specs if "set" in spec.presentation.family
            }
            bounded = {name: of for name, of in built.items() if isinstance(of, SetMembershipFilter)}
            sets += containment(records, bounded, suite.protocol(T))
    return _write(suite, found, limits, sets, records, costs)


def _refuse_mistakes(suite: FullSuite, preset: Preset) -> None:
    """Refuse mistakes now, not after the training of other methods."""
    if suite.member_physics == "reduced" and any(spec.ensembles for spec in suite.specs):
        refuse_gravity(preset)
    if any(find_training(agent).on_twins for agent in suite.agents_to_train):
        check_members([preset])
    for path in suite.data:
        for T in (SAMPLE_TIME, *suite.sample_times):
            evaluation_records([path], T)
    if suite.train:
        true_records([suite.train], max(suite.sample_times))


def _claim(suite: FullSuite, preset: Preset, ranges: Ranges) -> None:
    """Refuse a folder whose records, fits and networks were made from something else."""
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


def _records(suite: FullSuite, preset: Preset, ranges: Ranges, progress: NewProgress) -> tuple[Path, ...]:
    """Return the files of the suite's own records, simulated where they are missing."""
    shown = progress("test records", "ep")
    name, make = RECORDS[suite.suite]
    paths = write_scenarios(suite.folder / name, preset, ranges, suite.seconds, suite.seed, make)
    shown(len(paths), len(paths))
    return tuple(paths)


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
    """Identify the models and find the fits on the training records, or read those of an earlier run."""
    folder = suite.folder / f"T_{T:g}"
    folder.mkdir(parents=True, exist_ok=True)
    measured = [piece for episode in read_episodes([train], T) for piece in complete_pieces(episode)]
    models = identify_models(measured, folder, suite.seed, progress(f"identify T = {T:g} s", "model"))
    path = folder / "tuned.json"
    knowledge = Knowledge(
        sample_time=T,
        models=models,
        records=true_records([train], T),
        seed=suite.seed,
        fits=load_fits(path),
        smallest_wire_offset=ranges.lowest("wire_offset", preset),
        twins=(preset, ranges),
    )
    missing = [fit for fit in needed_fits(suite.specs) if fit.key not in knowledge.fits]
    if missing:
        jobs = {fit.key: executor.submit(fit.find, knowledge) for fit in missing}
        _wait_for(list(jobs.values()), progress(f"tune T = {T:g} s", "filter"))
        fits = {**knowledge.fits, **{key: job.result() for key, job in jobs.items()}}
        save_fits(path, fits)
        knowledge = dataclasses.replace(knowledge, fits=fits)
    trained = {
        # An estimator on twins takes T as an input: one serves all sample times.
        agent: _files(suite, (suite.folder if training.on_twins else folder) / agent, training.file)
        for agent, training in trainings().items()
        if agent in suite.agents
    }
    return dataclasses.replace(knowledge, trained=trained | suite.trained)


def _files(suite: FullSuite, folder: Path, name: str) -> tuple[Path, ...]:
    """Return the files of the training runs of an agent: that with the suite's seed is in its own folder."""
    further = range(suite.seed + 1, suite.seed + suite.trainings)
    return (folder / name, *(folder_of(folder, seed) / name for seed in further))


def _train_all(
    suite: FullSuite, known: Sequence[Knowledge], executor: Executor, progress: NewProgress
) -> None:
    """Train every learned method that is not given, at every sample time, on as many samples at each."""
    # PPO takes longest: what begins last would leave the other workers idle.
    agents = sorted(suite.agents_to_train, key=lambda agent: not find_trainer(agent).counts_samples)
    jobs = [
        executor.submit(
            train_one,
            agent,
            dataclasses.replace(knowledge, training=number),
            suite.episodes,
            suite.seed + number,
        )
        for agent in agents
        for knowledge in (known[:1] if find_training(agent).on_twins else known)
        for number in range(suite.trainings)
    ]
    if jobs:
        _wait_for(jobs, progress("train", "training"))


def train_one(agent: str, knowledge: Knowledge, episodes: int, seed: int) -> None:
    """Train one method under the strict protocol, in a worker; a finished one is left as it is."""
    trainer = find_trainer(agent)
    count = episodes_at(trainer, episodes, knowledge.sample_time)
    options = TrainingOptions(agent=agent, episodes=count, seed=seed)
    trainer.run(material_of(knowledge), options, knowledge.file_of(agent).parent)


def episodes_at(trainer: Trainer, episodes: int, sample_time: float) -> int:
    """Return the episodes that are as many samples at a sample time [s] as some are at the paper's."""
    share = sample_time / PAPER_SAMPLE_TIME if trainer.counts_samples else 1.0
    return max(round(episodes * share), 1)


def _ensembles_along(
    suite: FullSuite, data: Sequence[Path], preset: Preset, ranges: Ranges, progress: NewProgress
) -> tuple[tuple[Path, ...], ...]:
    """Simulate ensembles along the commands of the test, where a method needs them."""
    if not any(spec.ensembles for spec in suite.specs):
        return ()
    pulls = {episode.pull.tobytes(): episode.pull for episode in read_episodes(data, SAMPLE_TIME)}
    return tuple(
        tuple(
            make_ensembles(
                preset,
                ranges,
                list(pulls.values()),
                suite.folder / "ensembles",
                count=suite.members,
                seed=suite.seed,
                first=number * suite.members,
                physics=suite.member_physics,
                on_progress=progress("ensembles", "command"),
            )
        )
        for number in range(suite.ensembles)
    )


def _wait_for(futures: Sequence[Any], progress: OnProgress) -> None:
    """Wait for all of some futures, and show the number of finished ones."""
    progress(0, len(futures))
    for count, future in enumerate(as_completed(futures), start=1):
        future.result()
        progress(count, len(futures))


def _write(
    suite: FullSuite,
    found: Sequence[Comparison],
    limits: list[dict[str, Any]],
    sets: list[dict[str, Any]],
    records: Sequence[Record],
    costs: Mapping[str, Cost],
) -> FullResult:
    """Write all results; tracks are of the first sample time."""
    folder, tracks = suite.folder, found[0].tracks
    scores = [score for of in found for score in of.scores]
    rankings = [ranking for of in found for ranking in of.rankings]
    save_runs(folder / "runs.npz", scores, [squares for of in found for squares in of.squares])
    test_set = name_of_test_set(records, suite.sample_times[-1])
    protocol = {
        "suite": suite.suite,
        "seeds": suite.seeds,
        "initial_error_deg": suite.initial_error_deg,
        "seed": suite.seed,
        "sample_times_s": list(suite.sample_times),
        "preset": suite.preset,
        "records": len(records),
        "test_set": test_set,
        "members": suite.members,
        "ensembles": suite.ensembles,
        "member_physics": suite.member_physics,
        "episodes": suite.episodes,
        "trainings": suite.trainings,
        "data": [str(path) for path in suite.data],
        "train": str(suite.train or folder / "train"),
        "phi": "measured innovation; rows with oracle = true use the clean truth instead",
        "noise_information": {spec.name: spec.noise_information for spec in suite.specs},
        "policies": {agent: [*map(str, paths)] for agent, paths in suite.trained.items()},
    }
    contents = {
        "protocol": protocol,
        "rows": to_rows(scores),
        "ranks": [ranking.to_dict() for ranking in rankings],
        "bounds": limits,
        "intervals": sets,
        "costs": {method: dataclasses.asdict(cost) for method, cost in costs.items()},
        "origin": dict(suite.origin),
    }
    out = folder / "evaluation.json"
    write_whole(out, json.dumps(contents, indent=2, allow_nan=False) + "\n")
    tables = comparison_tables(scores, limits, sets, rankings, costs)
    write_whole(folder / "scores.csv", scores_csv(scores))
    write_whole(folder / "costs.csv", costs_csv(costs))
    write_whole(folder / "benchmark.md", f"{tables}\n<!-- {MADE_BY} -->\n")
    for name, page in condition_pages(scores).items():
        write_whole(folder / name, page)
    for name, picture in comparison_figures(scores, tracks, rankings).items():
        write_whole(folder / name, picture)
    save_tracks(folder / "tracks.npz", tracks)
    return FullResult(scores, len(records), test_set, out)
