"""The full suite of `endotwin evaluate`: records, fits, training, limit, tables and figures.

Every stage keeps what it made beside the results; a run that was stopped goes on from there.
"""

import dataclasses
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rl.learned import LEARNED, learned_methods, train_learned
from scripts.command import Progress, Summary
from twin import __version__
from twin.dataset.recipe import Recipe
from twin.dataset.write import write_dataset
from twin.estimation.active_model import ActiveModel
from twin.evaluation.compare import evaluate
from twin.evaluation.method import as_method
from twin.evaluation.protocol import SUITES, Protocol
from twin.evaluation.reading import evaluation_records, read_episodes, true_records, whole_pieces
from twin.evaluation.record import EvaluationRecord
from twin.evaluation.track import save_tracks
from twin.files.atomic import write_whole
from twin.files.run_folder import claim_folder
from twin.hysteresis import ColemanHodgdon
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges, load_ranges
from twin.report.summary import benchmark_figures, benchmark_tables
from twin.suite.fitting import (
    TUNED_WITH,
    Fits,
    best_gain,
    identify_models,
    koopman_variances,
    load_fits,
    save_fits,
    tune,
)
from twin.suite.intervals import containment
from twin.suite.limit import bounds, limit_methods, make_ensembles
from twin.suite.methods import active_methods, set_filters, static_methods, tuned_methods
from twin.suite.scenarios import SAMPLE_TIME, write_scenarios
from twin.workers.processes import local_workers

Array = NDArray[np.float64]
SAMPLE_TIMES = (0.1, 0.02)
TRAINING_STROKE_MM = (2.0, 4.0)  # the paper's


@dataclasses.dataclass(frozen=True)
class FullSuite:
    """What the benchmark is run on."""

    folder: Path
    data: tuple[Path, ...]
    """Test records; without them, the benchmark's own are simulated."""
    train: Path | None
    """Training records; without them, five on the paper's stroke are simulated."""
    preset: str
    sample_times: tuple[float, ...]
    seeds: int
    initial_error_deg: float
    episodes: int
    """As in `train_learned`."""
    members: int
    seconds: float
    workers: int
    seed: int

    def __post_init__(self) -> None:
        """Refuse what would fail after hours.

        Raises:
            ValueError: a number is out of range.
        """
        for T in self.sample_times:
            self.protocol(T)
            if T < SAMPLE_TIME or abs(T / SAMPLE_TIME - round(T / SAMPLE_TIME)) > 1e-9:
                raise ValueError(f"--sample-time {T:g}: must be a multiple of {SAMPLE_TIME:g} s")
        if self.members < 8:
            raise ValueError(f"--members {self.members}: an ensemble needs at least 8")
        if self.seconds < 5:
            raise ValueError(f"--seconds {self.seconds:g}: must be at least 5")
        if self.train and self.train.resolve() in {path.resolve() for path in self.data}:
            raise ValueError(f"--train {self.train} is test data too: what is trained there proves nothing")

    def protocol(self, sample_time: float) -> Protocol:
        """Return how methods are compared at one sample time."""
        return Protocol("full", self.seeds, sample_time, self.initial_error_deg, self.seed)


def run_full_suite(suite: FullSuite) -> Summary:
    """Write `evaluation.json`, `benchmark.md`, figures and tracks."""
    preset, ranges = load_preset(suite.preset), load_ranges(suite.preset)
    for path, T in ((path, T) for path in suite.data for T in (SAMPLE_TIME, *suite.sample_times)):
        evaluation_records([path], T)  # a mistake is told now, not after the training
    if suite.train:
        true_records([suite.train], max(suite.sample_times))
    _claim(suite, preset, ranges)
    with local_workers(suite.workers or os.cpu_count() or 1) as executor:
        data = suite.data
        if not data:
            print("test records", file=sys.stderr)
            data = tuple(write_scenarios(suite.folder / "records", preset, ranges, suite.seconds, suite.seed))
        train = suite.train or _training_records(suite, preset, executor)
        training = {T: true_records([train], T) for T in suite.sample_times}
        fits = {T: _fit(suite, train, T, records, executor) for T, records in training.items()}
        _train(suite, training, fits, executor)
        pulls = {episode.pull.tobytes(): episode.pull for episode in read_episodes(data, SAMPLE_TIME)}
        ensembles = make_ensembles(
            preset,
            ranges,
            list(pulls.values()),
            suite.folder / "ensembles",
            count=suite.members,
            seed=suite.seed,
            on_progress=Progress("ensembles", "command"),
        )
        rows, limits, sets, tracks = [], [], [], []
        for T in suite.sample_times:
            records = evaluation_records(data, T)
            bounded = set_filters(fits[T], training[T], T, ranges.lowest("wire_offset", preset))
            methods = [
                *static_methods(fits[T]),
                *active_methods(fits[T], T),
                *(as_method(name, filter_) for name, filter_ in bounded.items()),
                *tuned_methods(fits[T], training[T], T),
                *learned_methods(_active_model(fits[T], T), _folder(suite, T)),
                *limit_methods(ensembles, T),
            ]
            progress = Progress(f"evaluate T = {T:g} s", "group")
            found, seen = evaluate(records, methods, suite.protocol(T), progress, executor)
            rows += found
            limits += bounds(records, ensembles, T, SUITES["full"])
            sets += containment(records, bounded, suite.protocol(T))
            tracks.append(seen)
    return _write(suite, rows, limits, sets, tracks[0], records)


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


def _training_records(suite: FullSuite, preset: Preset, executor: Executor) -> Path:
    """Simulate five records on the paper's training stroke, one of each kind of signal."""
    folder = suite.folder / "train"
    if not (folder / "dataset.json").is_file():
        recipe = Recipe(preset, (TRAINING_STROKE_MM,), seconds=suite.seconds, seeds=(suite.seed,))
        progress = Progress("training records", "ep")
        write_dataset(
            recipe, folder, executor, workers=suite.workers or os.cpu_count() or 1, on_progress=progress
        )
    return folder


def _folder(suite: FullSuite, T: float) -> Path:
    """Where all that is made for one sample time is kept."""
    return suite.folder / f"T_{T:g}"


def _active_model(fits: Fits, T: float) -> ActiveModel:
    return ActiveModel(fits.models[ColemanHodgdon.name], T)


def _fit(
    suite: FullSuite, train: Path, T: float, records: list[tuple[Array, Array]], executor: Executor
) -> Fits:
    """Identify the models, and tune filters by workers."""
    folder = _folder(suite, T)
    folder.mkdir(parents=True, exist_ok=True)
    measured = [piece for episode in read_episodes([train], T) for piece in whole_pieces(episode)]
    models = identify_models(measured, folder, suite.seed, Progress(f"identify T = {T:g} s", "model"))
    path = folder / "tuned.json"
    if not path.is_file():
        jobs: dict[str, Any] = {
            name: executor.submit(tune, name, models, records, T, suite.seed) for name in TUNED_WITH
        }
        gain = executor.submit(best_gain, models, records, T, suite.seed)
        koopman = executor.submit(koopman_variances, records, suite.seed)
        _wait([*jobs.values(), gain, koopman], Progress(f"tune T = {T:g} s", "filter"))
        tuned = {name: job.result() for name, job in jobs.items()}
        save_fits(path, Fits(models, tuned, gain.result(), koopman.result()))
    return load_fits(path, models)


def _train(
    suite: FullSuite,
    training: dict[float, list[tuple[Array, Array]]],
    fits: dict[float, Fits],
    executor: Executor,
) -> None:
    """Train every learned method at every sample time, on as many samples at each."""
    jobs = [
        executor.submit(
            train_learned,
            agent,
            records,
            _active_model(fits[T], T),
            _folder(suite, T),
            suite.episodes,
            suite.seed,
        )
        for agent in LEARNED
        for T, records in training.items()
    ]
    _wait(jobs, Progress("train", "method"))


def _wait(futures: Sequence[Any], progress: Progress) -> None:
    progress(0, len(futures))
    for done, future in enumerate(as_completed(futures), start=1):
        future.result()
        progress(done, len(futures))


def _write(
    suite: FullSuite,
    rows: list[dict[str, Any]],
    limits: list[dict[str, Any]],
    sets: list[dict[str, Any]],
    tracks: Sequence[Any],
    records: Sequence[EvaluationRecord],
) -> Summary:
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
        "told": "docs/method.md: all but LSTM, Direct RL, AM-tuned (Q, R) and models alone are told R; "
        "ESMF the largest magnitude of the noise; Ensemble (limit) its density",
    }
    contents = {"protocol": protocol, "rows": rows, "bounds": limits, "intervals": sets}
    write_whole(folder / "evaluation.json", json.dumps(contents, indent=2, allow_nan=False) + "\n")
    write_whole(folder / "benchmark.md", benchmark_tables(rows, limits, sets))
    for name, picture in benchmark_figures(rows, tracks).items():
        write_whole(folder / name, picture)
    save_tracks(folder / "tracks.npz", tracks)
    methods, out = list(dict.fromkeys(row["method"] for row in rows)), folder / "evaluation.json"
    line = f"{out}: {len(methods)} methods, {len(records)} records, {suite.seeds} noise seeds"
    return Summary(line, {"out": str(out), "methods": methods, "rows": len(rows)})
