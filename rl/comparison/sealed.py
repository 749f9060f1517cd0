"""The sealed comparison: conditions that the files under test determine, after all else is fixed."""

import csv
import dataclasses
import datetime
import functools
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from rl.comparison.full import (
    NewProgress,
    claim,
    learn,
    refuse_mistakes,
    train_missing,
    training_records,
)
from rl.comparison.paper import RESULTS, write_results
from rl.comparison.settings import Result, Suite
from twin.episode import Record
from twin.errors import InputError, MissingFileError
from twin.estimation.registry import load_method_files
from twin.evaluation.compare import Comparison
from twin.evaluation.method import build_method
from twin.evaluation.protocol import SEALED, Condition
from twin.evaluation.ranking import competes
from twin.evaluation.sealed import (
    CONDITIONS,
    SealedCondition,
    draw_conditions,
    sealed_seed,
    simulate_conditions,
    simulate_members,
    test_set_name,
)
from twin.evaluation.sealed_scores import (
    SealedResult,
    compare_sealed,
    sealed_scores,
    summary_of,
)
from twin.evaluation.yardsticks import write_ensemble
from twin.files.atomic import MADE_BY, write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.preset import Preset, Ranges, load_preset, load_ranges
from twin.report.publication import NAMES, write_publication
from twin.report.sealed_tables import sealed_rows, sealed_tables
from twin.report.tables import csv_text
from twin.workers.processes import choose_workers

RUNS_FILE = "sealed_runs.csv"
MOST_RUNS_BYTES = 16 * MEBIBYTE
RUN_COLUMNS = ("date", "test_set", "number", "method", "rmse_deg")
SEALED_FILES = RESULTS | {
    "conditions.csv": "endoscope,physics",
    "sealed.csv": "method,knows",
    RUNS_FILE: ",".join(RUN_COLUMNS),
    **dict.fromkeys(["sealed.md", *NAMES], MADE_BY),
}
"""Files of the sealed suite, and a mark by which each is recognised."""
FIXED_SEED = 0  # of training records, fits and trainings: the number of a test set changes none of them


def run_sealed_suite(suite: Suite, progress: NewProgress) -> Result:
    """Draw the conditions, run all methods on them, and write the results.

    `suite.seed` is the number of the test set. Every run is a line of `sealed_runs.csv`.
    """
    preset, ranges = load_preset(suite.preset), load_ranges(suite.preset)
    (T,) = suite.sample_time
    fixed = dataclasses.replace(suite, seed=FIXED_SEED)
    refuse_mistakes(fixed, preset)
    suite.out.mkdir(parents=True, exist_ok=True)
    claim(fixed, preset, ranges)
    earlier = _earlier_runs(suite.out / RUNS_FILE)
    given = [*suite.method_file, *(path for paths in suite.trained.values() for path in paths)]
    load_methods = functools.partial(load_method_files, suite.method_file) if suite.method_file else None
    with choose_workers(suite.workers, suite.workers, suite.dask, load_methods) as (executor, _):
        train = suite.train or training_records(fixed, preset, executor, progress)
        knowledge = learn(fixed, train, T, preset, ranges, executor, progress)
        train_missing(fixed, [knowledge], executor, progress)
        seed = sealed_seed(given, suite.seed)
        conditions = draw_conditions(preset, ranges, suite.seconds, seed, CONDITIONS)
        shown = progress("simulate", "condition")
        shown(0, CONDITIONS)
        records = simulate_conditions(conditions, T)
        shown(CONDITIONS, CONDITIONS)
        ensembles = _ensembles(suite, conditions, records, seed, preset, ranges, executor, progress)
        knowledge = dataclasses.replace(knowledge, ensembles=ensembles)
        methods = [build_method(spec, knowledge) for spec in suite.specs]
        shown = progress(f"evaluate T = {T:g} s", "condition")
        results = compare_sealed(conditions, records, methods, suite.draws, seed, shown, executor)
    scores, rankings = sealed_scores(conditions, methods, results, T)
    squares = [results[score.method].errors["rmse_deg"] ** 2 for score in scores]
    chosen = [[score.twin in condition.kinds for condition in conditions] for score in scores]
    squares = [of[:, which] for of, which in zip(squares, chosen, strict=True)]
    tracks = _tracks(conditions, records, results)
    name = test_set_name(seed)
    runs = [*earlier, *_lines(suite, name, results)]
    write_whole(suite.out / RUNS_FILE, csv_text(runs))
    tried = len({run["test_set"] for run in runs})
    protocol = {
        "suite": suite.suite,
        "test_set": name,
        "number": suite.seed,
        "test_sets_in_this_folder": tried,
        "conditions": CONDITIONS,
        "seeds": suite.draws,
        "sample_times_s": [T],
        "seconds": suite.seconds,
        "preset": suite.preset,
        "members": suite.count_of_members,
        "train": str(train),
        "files": [str(path) for path in given],
    }
    write_results(suite, [Comparison(scores, tracks, rankings, squares)], protocol)
    racing = [method.name for method in methods if competes(method.name, method.oracle)]
    remark = f"Test set {name} (number {suite.seed}); test sets tried in this folder: {tried}."
    rows = sealed_rows(scores, {method: summary_of(method, results) for method in racing})
    counts = {score.twin: int(score.level) for score in scores if score.group != scores[0].group}
    text = f"{remark}\n\n{sealed_tables(rows, counts)}\n\n<!-- {MADE_BY} -->\n"
    write_whole(suite.out / "sealed.md", text)
    write_whole(suite.out / "sealed.csv", csv_text(rows))
    write_whole(suite.out / "conditions.csv", _conditions_csv(conditions, results))
    write_publication(suite.out, scores, tracks, rankings, suite.format)
    return Result(scores, tracks, CONDITIONS, f"; {remark[0].lower()}{remark[1:-1]}")


def _ensembles(
    suite: Suite,
    conditions: Sequence[SealedCondition],
    records: Sequence[Record],
    seed: int,
    preset: Preset,
    ranges: Ranges,
    executor: Executor,
    progress: NewProgress,
) -> tuple[tuple[Path, ...], ...]:
    """Simulate ensembles along the conditions, where a method needs them."""
    if not any(spec.ensembles for spec in suite.specs):
        return ()
    folder = suite.out / "ensembles"
    folder.mkdir(exist_ok=True)
    (T,), count, found = suite.sample_time, suite.count_of_members, []
    for place in range(suite.ensembles):
        shown = progress("ensembles", "condition")
        shown(0, len(conditions))
        name = f"{test_set_name(seed)}_{place}_{count}_{T:g}"
        paths = [folder / f"{name}_{k:03d}.npz" for k in range(len(conditions))]
        missing = [k for k, path in enumerate(paths) if not path.is_file()]
        make = functools.partial(
            simulate_members, preset=preset, ranges=ranges, count=count, seed=place, sample_time=T
        )
        made = executor.map(make, [conditions[k] for k in missing])
        for done, (k, bend) in enumerate(zip(missing, made, strict=True), start=1):
            write_ensemble(paths[k], records[k].pull_mm, bend, T)
            shown(len(conditions) - len(missing) + done, len(conditions))
        found.append(tuple(paths))
    return tuple(found)


def _tracks(
    conditions: Sequence[SealedCondition], records: Sequence[Record], results: Mapping[str, SealedResult]
) -> dict[Condition, Record]:
    """Return the first condition with all estimates; its measurements are not kept."""
    estimates = {name: of.estimates[0] for name, of in results.items()}
    track = dataclasses.replace(records[0], source="", estimates=estimates)
    return {(SEALED, float(len(conditions))): track}


def _conditions_csv(conditions: Sequence[SealedCondition], results: Mapping[str, SealedResult]) -> str:
    """Return a line for each condition: what it is, and the RMSE of each method [deg]."""
    errors = {f"rmse_deg of {name}": of.rmse_deg for name, of in results.items()}
    lines = [
        of.facts() | {name: float(rmse[k]) for name, rmse in errors.items()}
        for k, of in enumerate(conditions)
    ]
    return csv_text(lines, digits=6)


def _earlier_runs(path: Path) -> list[dict[str, str]]:
    """Return the lines of the runs in this folder, before the work: a damaged list loses nothing."""
    try:
        lines = read_limited(path, MOST_RUNS_BYTES).decode().splitlines()
    except MissingFileError:
        return []
    except UnicodeDecodeError:
        lines = []
    rows = list(csv.reader(lines))
    if not rows or any(len(row) != len(RUN_COLUMNS) for row in rows):
        raise InputError(f"{path} is damaged: move it elsewhere")
    return [dict(zip(RUN_COLUMNS, row, strict=True)) for row in rows[1:]]


def _lines(suite: Suite, test_set: str, results: Mapping[str, SealedResult]) -> list[dict[str, str]]:
    """Return the lines of this run, one for each method."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    rmse = {name: float(np.exp(np.log(of.rmse_deg).mean())) for name, of in results.items()}
    cells = ((now, test_set, str(suite.seed), name, f"{of:.4f}") for name, of in rmse.items())
    return [dict(zip(RUN_COLUMNS, of, strict=True)) for of in cells]
