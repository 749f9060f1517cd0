"""The full benchmark of `endotwin evaluate --suite full`: records, fits, training, limit, tables and figures.

Every stage keeps what it made beside the results; a run that was stopped goes on from there.
"""

import dataclasses
import json
import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import torch

from rl.gru import GRU_FILE, GruTraining, load_gru, train_gru
from rl.kalman_net import KALMAN_NET_FILE, KalmanNetTraining, load_kalman_net, train_kalman_net
from rl.lstm import LSTM_FILE, LstmEstimator, LstmTraining, load_lstm, train_lstm
from rl.methods import oracle_method, policy_method
from rl.policy import load_policy
from rl.training import Training, train_policy
from scripts.command import Progress, Summary
from scripts.records import read_episodes, test_records, true_records, whole_pieces
from twin.benchmark.fitting import TUNED_WITH, Fits, best_gain, identify_models, load_fits, save_fits, tune
from twin.benchmark.intervals import containment
from twin.benchmark.limit import bounds, limit_methods, make_ensembles
from twin.benchmark.methods import active_methods, set_filters, static_methods, tuned_methods
from twin.benchmark.scenarios import SAMPLE_TIME, write_scenarios
from twin.benchmark.summary import benchmark_figures, benchmark_tables
from twin.dataset import Recipe, write_dataset
from twin.estimation.active_model import ActiveModel
from twin.estimation.set_membership import SetMembershipFilter
from twin.evaluation import SUITES, Method, Protocol, evaluate, filtering
from twin.hysteresis import ColemanHodgdon, load_model
from twin.preset import load_preset
from twin.randomization import load_ranges
from twin.recording.atomic import write_whole
from twin.test_record import TestRecord
from twin.track import save_tracks

SAMPLE_TIMES = (0.1, 0.02)
TRAINING_STROKE = (2e-3, 4e-3)  # the paper's
LEARNED = ("ram", "direct", "lstm", "gru", "kalman-net")


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
    """Of PPO at T = 0.1 s; networks are trained for this share of their own 2000."""
    members: int
    seconds: float
    workers: int
    seed: int

    def protocol(self, sample_time: float) -> Protocol:
        """Return how methods are compared at one sample time."""
        return Protocol("full", self.seeds, sample_time, self.initial_error_deg, self.seed)


def run_full_suite(suite: FullSuite) -> Summary:
    """Write `evaluation.json`, `benchmark.md`, figures and tracks."""
    for sample_time in suite.sample_times:
        suite.protocol(sample_time)
        if (
            abs(sample_time / SAMPLE_TIME - round(sample_time / SAMPLE_TIME)) > 1e-9
            or sample_time < SAMPLE_TIME
        ):
            raise ValueError(f"--sample-time {sample_time:g}: must be a multiple of {SAMPLE_TIME:g} s")
    if suite.members < 8:
        raise ValueError(f"--members {suite.members}: an ensemble needs at least 8")
    preset, ranges = load_preset(suite.preset), load_ranges(suite.preset)
    workers = suite.workers or os.cpu_count() or 1
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as executor:
        data = suite.data
        if not data:
            print("test records", file=sys.stderr)
            data = tuple(write_scenarios(suite.folder / "records", preset, ranges, suite.seconds, suite.seed))
        train = suite.train or _training_records(suite, executor)
        folders = {T: suite.folder / f"T_{T:g}" for T in suite.sample_times}
        fits = {T: _fit(suite, train, T, folder, executor) for T, folder in folders.items()}
        _train(suite, train, folders, executor)
        finest = test_records(data, SAMPLE_TIME)
        pulls = {record.pull_mm.tobytes(): record.pull_mm * 1e-3 for record in finest}
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
        for T, folder in folders.items():
            records = test_records(data, T)
            training = true_records([train], T)
            bounded = set_filters(fits[T], training, T, ranges.lowest("wire_offset", preset))
            methods = _methods(fits[T], training, bounded, folder, T) + limit_methods(ensembles, T)
            found, seen = evaluate(
                records, methods, suite.protocol(T), Progress(f"evaluate T = {T:g} s", "group"), executor
            )
            rows += found
            limits += bounds(records, ensembles, T, SUITES["full"])
            sets += containment(records, bounded, suite.protocol(T))
            tracks.append(seen)
    return _write(suite, rows, limits, sets, tracks[0], records)


def _training_records(suite: FullSuite, executor: Executor) -> Path:
    """Simulate five records on the paper's training stroke, one of each kind of signal."""
    folder = suite.folder / "train"
    recipe = Recipe(load_preset(suite.preset), TRAINING_STROKE, seconds=suite.seconds, seed=suite.seed)
    if not (folder / "dataset.json").is_file():
        write_dataset(
            recipe, len(recipe.signals), folder, executor, on_episode=Progress("training records", "ep")
        )
    return folder


def _fit(suite: FullSuite, train: Path, T: float, folder: Path, executor: Executor) -> Fits:
    """Identify the models, and tune filters by workers."""
    folder.mkdir(parents=True, exist_ok=True)
    measured = [piece for episode in read_episodes([train], T) for piece in whole_pieces(episode)]
    models = identify_models(measured, folder, suite.seed, Progress(f"identify T = {T:g} s", "model"))
    path = folder / "tuned.json"
    if not path.is_file():
        truth = true_records([train], T)
        jobs: dict[str, Any] = {
            name: executor.submit(tune, name, models, truth, T, suite.seed) for name in TUNED_WITH
        }
        jobs["gain"] = executor.submit(best_gain, models, truth, T, suite.seed)
        _wait(list(jobs.values()), Progress(f"tune T = {T:g} s", "filter"))
        tuned = {name: jobs[name].result() for name in TUNED_WITH}
        save_fits(path, Fits(models, tuned, jobs["gain"].result()))
    return load_fits(path, models)


def _train(suite: FullSuite, train: Path, folders: dict[float, Path], executor: Executor) -> None:
    """Train every learned method at every sample time, on as many samples at each."""
    jobs = [
        executor.submit(train_learned, agent, train, T, folder, suite.episodes, suite.seed)
        for agent in LEARNED
        for T, folder in folders.items()
    ]
    _wait(jobs, Progress("train", "method"))


def train_learned(agent: str, train: Path, T: float, folder: Path, episodes: int, seed: int) -> None:
    """Train one method into its folder, under the strict protocol; a finished one is left as it is."""
    torch.set_num_threads(1)
    records = true_records([train], T)
    active_model = ActiveModel(load_model(folder / f"{ColemanHodgdon.name.replace('-', '_')}.json"), T)
    share, out = episodes / Training.episodes, folder / agent
    if agent in ("ram", "direct"):
        count = max(round(episodes * T / 0.1), 1)
        train_policy(records, active_model, Training(agent=agent, episodes=count, seed=seed), out)
        return
    kinds: dict[str, tuple[Any, Callable[..., Any]]] = {
        "lstm": (LstmTraining, train_lstm),
        "gru": (GruTraining, train_gru),
        "kalman-net": (KalmanNetTraining, train_kalman_net),
    }
    settings, learn = kinds[agent]
    iterations = max(round(settings.iterations * share), 1)
    learn(records, active_model, settings(iterations=iterations, seed=seed), out)


def _methods(
    fits: Fits, training: Sequence[Any], bounded: dict[str, SetMembershipFilter], folder: Path, T: float
) -> list[Method]:
    active_model = ActiveModel(fits.models[ColemanHodgdon.name], T)
    ram, direct = (load_policy(folder / agent / "policy.onnx") for agent in ("ram", "direct"))
    return [
        *static_methods(fits),
        *active_methods(fits, T),
        *(filtering(name, filter_) for name, filter_ in bounded.items()),
        *tuned_methods(fits, training, T),
        filtering("LSTM", LstmEstimator(load_lstm(folder / "lstm" / LSTM_FILE))),
        filtering("GRU", load_gru(folder / "gru" / GRU_FILE)),
        filtering("KalmanNet", load_kalman_net(folder / "kalman-net" / KALMAN_NET_FILE)),
        policy_method(direct, active_model),
        policy_method(ram, active_model),
        oracle_method(ram, active_model),
    ]


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
    records: Sequence[TestRecord],
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
        "filters_told": "variance and largest magnitude of the noise; Ensemble (limit) its density too",
    }
    contents = {"protocol": protocol, "rows": rows, "bounds": limits, "intervals": sets}
    write_whole(folder / "evaluation.json", json.dumps(contents, indent=2, allow_nan=False) + "\n")
    write_whole(folder / "benchmark.md", benchmark_tables(rows, limits, sets))
    for name, picture in benchmark_figures(rows, limits, tracks).items():
        write_whole(folder / name, picture)
    save_tracks(folder / "tracks.npz", tracks)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    line = (
        f"{folder}/evaluation.json: {len(methods)} methods, {len(records)} records, {suite.seeds} noise seeds"
    )
    return Summary(line, {"out": str(folder / "evaluation.json"), "methods": methods, "rows": len(rows)})
