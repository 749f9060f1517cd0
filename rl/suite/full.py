"""The full benchmark, end to end: records, fits, training, limit, scores, tables and figures.

Every stage keeps what it made beside the results; a run that was stopped goes on from there.
"""

import dataclasses
import functools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rl.suite.preparation import agents_to_train, ensembles_along, learn, train_all, training_records
from rl.suite.settings import FullSuite, NewProgress
from rl.suite.written import COSTS, SCORES
from twin import __version__
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_training, load_method_files
from twin.estimation.set_membership import SetMembershipFilter
from twin.evaluation.compare import evaluate
from twin.evaluation.costs import Cost, method_costs
from twin.evaluation.method import build_method
from twin.evaluation.ranking import Ranking
from twin.evaluation.reading import evaluation_records, true_records
from twin.evaluation.record import EvaluationRecord
from twin.evaluation.runs import save_runs
from twin.evaluation.score import Score, to_rows
from twin.evaluation.track import Track, save_tracks
from twin.files.atomic import MADE_BY, write_whole
from twin.files.run_folder import claim_folder
from twin.preset import Preset, Ranges, load_preset, load_ranges
from twin.reduced.member_set import check_members
from twin.reduced.parameters import refuse_gravity
from twin.report.comparison import comparison_tables, condition_pages, costs_csv, scores_csv
from twin.report.comparison_figures import comparison_figures
from twin.suite.frozen import frozen_name
from twin.suite.intervals import containment
from twin.suite.limit import bounds
from twin.suite.scenarios import SAMPLE_TIME, scenarios, write_scenarios
from twin.suite.untrained import untrained_scenarios
from twin.workers.processes import choose_workers

Array = NDArray[np.float64]


RECORDS = {"full": ("records", scenarios), "untrained": ("records_untrained", untrained_scenarios)}
"""Folder of the records of each suite, and what says what they are."""


@dataclasses.dataclass(frozen=True)
class FullResult:
    """Results of the benchmark.

    Attributes:
        scores: of every method.
        records: number of test records.
        test_set: name of the frozen test set, where the records are that; else None.
        path: of `evaluation.json`.
    """

    scores: list[Score]
    records: int
    test_set: str | None
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
    if suite.member_physics == "reduced" and any(spec.ensembles for spec in suite.specs):
        refuse_gravity(preset)
    if any(find_training(agent).on_twins for agent in agents_to_train(suite)):
        check_members([preset])  # a mistake is told now, not after the training of others
    for path, T in ((path, T) for path in suite.data for T in (SAMPLE_TIME, *suite.sample_times)):
        evaluation_records([path], T)  # a mistake is told now, not after the training
    if suite.train:
        true_records([suite.train], max(suite.sample_times))
    suite.folder.mkdir(parents=True, exist_ok=True)
    _claim(suite, preset, ranges)
    files = suite.method_files
    load_methods = functools.partial(load_method_files, files) if files else None
    with choose_workers(suite.workers, suite.workers, suite.dask, load_methods) as (executor, _):
        data = suite.data
        if not data:
            done = progress("test records", "ep")
            data = _records(suite, preset, ranges)
            done(len(data), len(data))
        train = suite.train or training_records(suite, preset, executor, progress)
        known = [learn(suite, train, T, preset, ranges, executor, progress) for T in suite.sample_times]
        train_all(suite, known, executor, progress)
        ensembles = ensembles_along(suite, data, preset, ranges, progress)
        scores: list[Score] = []
        rankings: list[Ranking] = []
        squares: list[Array] = []
        limits: list[dict[str, Any]] = []
        sets: list[dict[str, Any]] = []
        tracks: list[list[Track]] = []
        costs: dict[str, Cost] = {}
        records: list[EvaluationRecord] = []
        for knowledge in known:
            T = knowledge.sample_time
            records = evaluation_records(data, T)
            knowledge = dataclasses.replace(knowledge, ensembles=ensembles)
            methods = [build_method(spec, knowledge) for spec in suite.specs]
            costs = costs or method_costs(methods, records[0], _files(suite, knowledge))
            shown = progress(f"evaluate T = {T:g} s", "group")
            found = evaluate(records, methods, suite.protocol(T), shown, executor)
            scores += found.scores
            rankings += found.rankings
            squares += found.squares
            if ensembles:
                limits += bounds(records, list(ensembles[0]), T, suite.protocol(T).conditions)
            sets += containment(records, _bounded(suite, knowledge), suite.protocol(T))
            tracks.append(found.tracks)
    save_runs(suite.folder / "runs.npz", scores, squares)
    return _write(suite, scores, limits, sets, rankings, tracks[0], records, costs)


def _records(suite: FullSuite, preset: Preset, ranges: Ranges) -> tuple[Path, ...]:
    """Return the files of the suite's own records, simulated where they are not there."""
    name, make = RECORDS[suite.suite]
    return tuple(write_scenarios(suite.folder / name, preset, ranges, suite.seconds, suite.seed, make))


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


def _files(suite: FullSuite, knowledge: Knowledge) -> dict[str, tuple[Path, ...]]:
    """Trained files, by the name of the method that runs on them."""
    return {spec.name: knowledge.trained[spec.agent] for spec in suite.specs if spec.agent}


def _bounded(suite: FullSuite, knowledge: Knowledge) -> dict[str, SetMembershipFilter]:
    """Filters that state an interval, by name."""
    built = {spec.name: spec.build(knowledge) for spec in suite.specs if "set" in spec.presentation.family}
    return {name: filter_ for name, filter_ in built.items() if isinstance(filter_, SetMembershipFilter)}


def _write(
    suite: FullSuite,
    scores: list[Score],
    limits: list[dict[str, Any]],
    sets: list[dict[str, Any]],
    rankings: Sequence[Ranking],
    tracks: Sequence[Track],
    records: Sequence[EvaluationRecord],
    costs: Mapping[str, Cost],
) -> FullResult:
    folder = suite.folder
    test_set = frozen_name(records, suite.sample_times[-1])
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
    write_whole(folder / SCORES, scores_csv(scores))
    write_whole(folder / COSTS, costs_csv(costs))
    write_whole(folder / "benchmark.md", f"{tables}\n<!-- {MADE_BY} -->\n")
    for name, page in condition_pages(scores).items():
        write_whole(folder / name, page)
    for name, picture in comparison_figures(scores, tracks, rankings).items():
        write_whole(folder / name, picture)
    save_tracks(folder / "tracks.npz", tracks)
    return FullResult(scores, len(records), test_set, out)
