"""The full comparison, end to end: records, fits, training runs, limit, scores, tables and figures.

Every stage keeps its files with the results; a run that was stopped continues from there.
"""

import dataclasses
import functools
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any

from rl.comparison.paper import PHI, RESULTS, write_results
from rl.comparison.settings import Result, Suite
from rl.options import TRAINING_STROKE_MM, TrainingOptions
from rl.sweep import folder_of
from rl.trainers import find_trainer, material_of
from twin import __version__
from twin.dataset.recipe import Recipe
from twin.dataset.write import write_dataset
from twin.episode import Record
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_training, load_method_files, needed_fits, trainings
from twin.estimation.set_membership import SetMembershipFilter
from twin.evaluation.compare import Comparison, compare
from twin.evaluation.costs import Cost, method_costs
from twin.evaluation.fitting import identify_models, in_single_precision, load_fits
from twin.evaluation.method import build_method
from twin.evaluation.reading import complete_pieces, evaluation_records, read_episodes, true_records
from twin.evaluation.scenarios import (
    SAMPLE_TIME,
    name_of_test_set,
    scenarios,
    untrained_scenarios,
    write_scenarios,
)
from twin.evaluation.yardsticks import bounds, containment, make_ensembles
from twin.files.atomic import MADE_BY, write_whole
from twin.files.run_folder import claim_folder
from twin.preset import Preset, Ranges, load_preset, load_ranges
from twin.reduced.members import check_members
from twin.reduced.parameters import refuse_gravity
from twin.report.publication import NAMES, write_publication
from twin.report.tables import comparison_tables, condition_pages, costs_csv, page_names, scores_csv
from twin.workers.processes import choose_workers

OnProgress = Callable[[int, int], None]
NewProgress = Callable[[str, str], OnProgress]
"""Starts the progress display of a named stage, counted in a unit."""

SAMPLE_TIMES = (0.1, 0.02)
RECORDS = {"full": ("records", scenarios), "untrained": ("records_untrained", untrained_scenarios)}
"""Folder of the records of each suite, and their drives."""


def full_files() -> dict[str, str]:
    """Return the files of the full suite, with a page for each condition, and their marks."""
    tables = {"scores.csv": "method,oracle,noise", "costs.csv": "method,sample_us"}
    return RESULTS | tables | dict.fromkeys(["benchmark.md", *NAMES, *page_names()], MADE_BY)


def run_full_suite(suite: Suite, progress: NewProgress) -> Result:
    """Run all stages and write `evaluation.json`, `benchmark.md`, figures, runs and tracks.

    Raises `FileNotFoundError` for a path that does not exist, and `ValueError` where records do not fit or
    the folder holds another comparison.
    """
    preset, ranges = load_preset(suite.preset), load_ranges(suite.preset)
    refuse_mistakes(suite, preset)
    suite.out.mkdir(parents=True, exist_ok=True)
    claim(suite, preset, ranges)
    files = suite.method_file
    load_methods = functools.partial(load_method_files, files) if files else None
    with choose_workers(suite.workers, suite.workers, suite.dask, load_methods) as (executor, _):
        data = suite.data or _records(suite, preset, ranges, progress)
        train = suite.train or training_records(suite, preset, executor, progress)
        known = [learn(suite, train, T, preset, ranges, executor, progress) for T in suite.sample_time]
        train_missing(suite, known, executor, progress)
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


def refuse_mistakes(suite: Suite, preset: Preset) -> None:
    """Refuse mistakes before other methods are trained."""
    if suite.member_physics == "reduced" and any(spec.ensembles for spec in suite.specs):
        refuse_gravity(preset)
    if any(find_training(agent).on_twins for agent in _to_train(suite)):
        check_members([preset])
    for path in suite.data:
        for T in dict.fromkeys((SAMPLE_TIME, *suite.sample_time)):
            evaluation_records([path], T)
    if suite.train:
        true_records([suite.train], max(suite.sample_time))


def claim(suite: Suite, preset: Preset, ranges: Ranges) -> None:
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
    claim_folder(suite.out, json.loads(json.dumps(configuration)))


def _records(suite: Suite, preset: Preset, ranges: Ranges, progress: NewProgress) -> tuple[Path, ...]:
    """Return the files of the suite's own records, simulated where they are missing."""
    shown = progress("test records", "ep")
    name, make = RECORDS[suite.suite]
    paths = write_scenarios(suite.out / name, preset, ranges, suite.seconds, suite.seed, make)
    shown(len(paths), len(paths))
    return tuple(paths)


def training_records(suite: Suite, preset: Preset, executor: Executor, progress: NewProgress) -> Path:
    """Simulate five records on the paper's training stroke, one of each kind of signal."""
    folder = suite.out / "train"
    if not (folder / "dataset.json").is_file():
        recipe = Recipe(preset, (TRAINING_STROKE_MM,), seconds=suite.seconds, seeds=(suite.seed,))
        shown = progress("training records", "ep")
        write_dataset(recipe, folder, executor, workers=suite.workers, on_progress=shown)
    return folder


def learn(
    suite: Suite,
    train: Path,
    T: float,
    preset: Preset,
    ranges: Ranges,
    executor: Executor,
    progress: NewProgress,
) -> Knowledge:
    """Identify the models and find the fits on the training records, or read those of an earlier run."""
    folder = suite.out / f"T_{T:g}"
    folder.mkdir(parents=True, exist_ok=True)
    episodes = read_episodes([train], T)
    measured = [piece for episode in episodes for piece in complete_pieces(episode)]
    models = identify_models(measured, folder, suite.seed, progress(f"identify T = {T:g} s", "model"))
    path = folder / "tuned.json"
    knowledge = Knowledge(
        sample_time=T,
        models=models,
        records=[(episode.pull_mm, episode.truth_deg) for episode in episodes],
        seed=suite.seed,
        fits=load_fits(path),
        smallest_wire_offset=ranges.lowest("wire_offset", preset),
        twins=(preset, ranges),
    )
    missing = [fit for fit in needed_fits(suite.specs) if fit.key not in knowledge.fits]
    if missing:
        jobs = {fit.key: executor.submit(fit.find, knowledge) for fit in missing}
        _wait_for(list(jobs.values()), progress(f"tune T = {T:g} s", "filter"))
        found = {key: in_single_precision(job.result()) for key, job in jobs.items()}
        fits = {**knowledge.fits, **found}
        write_whole(path, json.dumps(fits, indent=2) + "\n")
        knowledge = dataclasses.replace(knowledge, fits=fits)
    trained = {
        # An estimator on twins takes T as an input: one serves all sample times.
        agent: _files(suite, (suite.out if training.on_twins else folder) / agent, training.file)
        for agent, training in trainings().items()
        if agent in suite.agents
    }
    return dataclasses.replace(knowledge, trained=trained | suite.trained)


def _files(suite: Suite, folder: Path, name: str) -> tuple[Path, ...]:
    """Return the files of the training runs of an agent: that with the suite's seed is in its own folder."""
    further = range(suite.seed + 1, suite.seed + suite.trainings)
    return (folder / name, *(folder_of(folder, seed) / name for seed in further))


def _to_train(suite: Suite) -> list[str]:
    return [agent for agent in suite.agents if agent not in suite.trained]


def train_missing(
    suite: Suite, known: Sequence[Knowledge], executor: Executor, progress: NewProgress
) -> None:
    """Train every learned method that is not given, at every sample time, on as many episodes at each."""
    # PPO, which counts samples, takes longest and starts first: else other workers would idle at the end.
    agents = sorted(_to_train(suite), key=lambda agent: find_trainer(agent).unit != "samples")
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
    options = TrainingOptions(agent=agent, episodes=episodes, seed=seed)
    trainer.run(material_of(knowledge), options, knowledge.file_of(agent).parent)


def _ensembles_along(
    suite: Suite, data: Sequence[Path], preset: Preset, ranges: Ranges, progress: NewProgress
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
                suite.out / "ensembles",
                count=suite.count_of_members,
                seed=suite.seed,
                first=number * suite.count_of_members,
                physics=suite.member_physics,
                on_progress=progress("ensembles", "command"),
            )
        )
        for number in range(suite.ensembles)
    )


def _wait_for(futures: Sequence[Any], progress: OnProgress) -> None:
    progress(0, len(futures))
    for count, future in enumerate(as_completed(futures), start=1):
        future.result()
        progress(count, len(futures))


def _write(
    suite: Suite,
    found: Sequence[Comparison],
    limits: list[dict[str, Any]],
    sets: list[dict[str, Any]],
    records: Sequence[Record],
    costs: Mapping[str, Cost],
) -> Result:
    """Write all results; tracks are of the first sample time."""
    tracks = found[0].tracks
    scores = [score for of in found for score in of.scores]
    rankings = [ranking for of in found for ranking in of.rankings]
    test_set = name_of_test_set(records, suite.sample_time[-1])
    settings = ("suite", "seeds", "initial_error_deg", "seed", "preset", "ensembles", "member_physics")
    protocol = {name: getattr(suite, name) for name in (*settings, "episodes", "trainings")}
    protocol["members"] = suite.count_of_members
    protocol |= {
        "sample_times_s": list(suite.sample_time),
        "records": len(records),
        "test_set": test_set,
        "data": [str(path) for path in suite.data],
        "train": str(suite.train or suite.out / "train"),
        "phi": PHI,
        "policies": {agent: [*map(str, paths)] for agent, paths in suite.trained.items()},
    }
    of_methods = {method: dataclasses.asdict(cost) for method, cost in costs.items()}
    write_results(suite, found, protocol, bounds=limits, intervals=sets, costs=of_methods)
    tables = comparison_tables(scores, limits, sets, rankings, costs)
    files = {
        "scores.csv": scores_csv(scores),
        "costs.csv": costs_csv(costs),
        "benchmark.md": f"{tables}\n<!-- {MADE_BY} -->\n",
        **condition_pages(scores),
    }
    for name, content in files.items():
        write_whole(suite.out / name, content)
    write_publication(suite.out, scores, tracks, rankings, suite.format)
    return Result(scores, tracks, len(records), f" (the frozen test set {test_set})" if test_set else "")
