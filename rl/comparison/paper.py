"""The paper's comparison: its methods and yardsticks on given records; missing methods are trained."""

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rl.options import TrainingOptions
from twin.episode import Record
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, find_training, method_specs, needed_fits
from twin.evaluation.compare import compare, write_estimates
from twin.evaluation.method import Method, build_method
from twin.evaluation.protocol import Condition, Protocol
from twin.evaluation.ranking import Ranking
from twin.evaluation.reading import evaluation_records, true_records
from twin.evaluation.results import save_runs, save_tracks
from twin.evaluation.score import Score, to_rows
from twin.export.export import named_files
from twin.files.atomic import MADE_BY, write_whole
from twin.hysteresis import ColemanHodgdon

FIGURES = [f"figure_{number:02d}.png" for number in range(100)]
RESULTS = {"evaluation.json": '"protocol"', "tracks.npz": "heads.npy", "runs.npz": "heads.npy"}
PAPER_FILES = RESULTS | dict.fromkeys(["tables.md", "rmse.png", *FIGURES], MADE_BY)
"""Files of the paper's suite, and a mark by which each is recognised."""

OnProgress = Callable[[int, int], None]
OnTraining = Callable[[int, int, float], None]


@dataclasses.dataclass(frozen=True)
class PaperSuite:
    """Everything that the comparison is run on.

    Attributes:
        folder: for results and for what is trained.
        data: test records.
        model: reference model; without it, only methods that need none are compared.
        protocol: noises, seeds, sample time and initial error.
        train: training records; without them, nothing is trained or tuned.
        trained: trained files of each agent that is given, one for each training of it.
        methods: names of the methods to compare; all of the suite, if empty.
        episodes: of PPO for policies that are not given.
        source: path of the model, as the results state it.
        write_estimates: whether each record is copied with the estimates from its own measurements.
        recorded_variance: R of these measurements [deg^2].
        origin: command, versions and hashes of the data, for `evaluation.json`.
    """

    folder: Path
    data: tuple[Path, ...]
    model: ColemanHodgdon | None
    protocol: Protocol
    train: Path | None = None
    trained: dict[str, tuple[Path, ...]] = dataclasses.field(default_factory=dict)
    methods: tuple[str, ...] = ()
    episodes: int = TrainingOptions.episodes
    source: str = ""
    write_estimates: bool = False
    recorded_variance: float = 0.1
    origin: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def specs(self) -> list[MethodSpec]:
        """Methods that may be compared: of the suite, and every one that is named or whose file is given."""
        if self.methods:
            return [spec for spec in method_specs() if spec.name in self.methods]
        return [
            spec for spec in method_specs() if spec.presentation.in_paper_suite or spec.agent in self.trained
        ]


@dataclasses.dataclass(frozen=True)
class PaperResult:
    """Results of the comparison.

    Attributes:
        scores: of every method.
        tracks: the first record with all estimates, by noise.
        methods: names of the compared methods.
        records: number of test records.
        estimates: files that were written with estimates.
    """

    scores: list[Score]
    tracks: dict[Condition, Record]
    methods: list[str]
    records: int
    estimates: list[Path]


def run_paper_suite(
    suite: PaperSuite, progress: OnProgress, training_progress: Callable[[str, str], OnTraining]
) -> PaperResult:
    """Train missing methods, compare, and write `evaluation.json`, `runs.npz` and `tracks.npz`.

    Args:
        suite: settings of the comparison.
        progress: called with the number of finished groups of records, and of all.
        training_progress: begins to show the progress of a named training run, counted in some unit.
    """
    T = suite.protocol.sample_time_s
    test = evaluation_records(suite.data, T)
    knowledge = Knowledge(
        sample_time=T,
        models={ColemanHodgdon.name: suite.model} if suite.model else {},
        records=true_records([suite.train], T) if suite.train else (),
        seed=suite.protocol.seed,
        trained=dict(suite.trained),
    )
    _refuse_what_cannot_run(suite, knowledge)
    estimate_files = named_files(suite.data) if suite.write_estimates else {}
    if knowledge.records and knowledge.models:
        knowledge = _train_missing(suite, knowledge, training_progress)
    ready = [spec for spec in suite.specs if spec.is_ready(knowledge)]
    fits = {fit.key: fit.find(knowledge) for fit in needed_fits(ready)}
    knowledge = dataclasses.replace(knowledge, fits=fits)
    methods = [build_method(spec, knowledge) for spec in ready]
    scores, tracks, rankings, squares = compare(test, methods, suite.protocol, progress)
    write_whole(suite.folder / "evaluation.json", _contents(suite, scores, rankings, len(test)))
    save_runs(suite.folder / "runs.npz", scores, squares)
    save_tracks(suite.folder / "tracks.npz", tracks)
    return PaperResult(
        scores, tracks, [spec.name for spec in ready], len(test), _estimates(suite, methods, estimate_files)
    )


def _refuse_what_cannot_run(suite: PaperSuite, knowledge: Knowledge) -> None:
    """Refuse named methods that lack something, before any work; a learned one is trained from records."""
    if knowledge.records and knowledge.models:
        trained = dict.fromkeys(_trained_on_records(suite), (Path(),))
        knowledge = dataclasses.replace(knowledge, trained=trained | dict(knowledge.trained))
    for spec in suite.specs if suite.methods else ():
        if missing := spec.unmet_requirements(knowledge):
            raise InputError(
                f"method {spec.name!r} needs {' and '.join(missing)}; the full suite makes all that it needs"
            )


def _trained_on_records(suite: PaperSuite) -> list[str]:
    """Agents of the compared methods that learn from records, each once."""
    agents = dict.fromkeys(spec.agent for spec in suite.specs if spec.agent)
    return [agent for agent in agents if not find_training(agent).on_twins]


def _train_missing(
    suite: PaperSuite, knowledge: Knowledge, training_progress: Callable[[str, str], OnTraining]
) -> Knowledge:
    """Train the learned methods whose files are not given, into the folder of the results."""
    from rl.trainers import find_trainer, material_of  # what is given needs no torch

    trained = dict(knowledge.trained)
    material = material_of(knowledge)
    for agent in _trained_on_records(suite):
        if agent not in trained:
            trainer = find_trainer(agent)
            options = TrainingOptions(agent=agent, episodes=suite.episodes, seed=suite.protocol.seed)
            shown = training_progress(f"train {agent}", trainer.unit)
            trained[agent] = (trainer.run(material, options, suite.folder / agent, shown),)
    return dataclasses.replace(knowledge, trained=trained)


def _estimates(suite: PaperSuite, methods: Sequence[Method], files: Mapping[str, Path]) -> list[Path]:
    if not files:
        return []
    folder = suite.folder / "estimates"
    folder.mkdir(exist_ok=True)
    protocol = suite.protocol
    return write_estimates(
        files,
        methods,
        protocol.sample_time_s,
        suite.recorded_variance,
        folder,
        protocol.initial_error_deg,
    )


def _contents(suite: PaperSuite, scores: Sequence[Score], rankings: Sequence[Ranking], records: int) -> str:
    protocol = {
        **dataclasses.asdict(suite.protocol),
        "records": records,
        "phi": "measured innovation; rows with oracle = true use the clean truth instead",
        "noise_information": "the variance of the noise as R",
        "process_variance": list(ActiveModel.process_variance),
        "initial_variance": list(ActiveModel.initial_variance),
        "model": suite.source,
        "policies": [str(path) for paths in suite.trained.values() for path in paths],
    }
    contents = {
        "protocol": protocol,
        "rows": to_rows(scores),
        "ranks": [ranking.to_dict() for ranking in rankings],
        "origin": dict(suite.origin),
    }
    return json.dumps(contents, indent=2, allow_nan=False) + "\n"
