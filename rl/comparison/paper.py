"""The paper's comparison: its methods and yardsticks on given records; missing methods are trained."""

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rl.comparison.settings import Result, Suite
from rl.options import TrainingOptions
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_training, needed_fits
from twin.evaluation.compare import Comparison, compare, write_estimates
from twin.evaluation.method import build_method
from twin.evaluation.reading import DEFAULT_VARIANCE, evaluation_records, true_records
from twin.evaluation.results import save_runs, save_tracks
from twin.export.export import named_files
from twin.files.atomic import MADE_BY, write_whole
from twin.hysteresis import ColemanHodgdon
from twin.report.publication import NAMES, write_publication

RESULTS = {"evaluation.json": '"protocol"', "tracks.npz": "heads.npy", "runs.npz": "heads.npy"}
PAPER_FILES = RESULTS | dict.fromkeys(["tables.md", *NAMES], MADE_BY)
"""Files of the paper's suite, and a mark by which each is recognised."""

PHI = "measured innovation; rows with oracle = true use the clean truth instead"
OnProgress = Callable[[int, int], None]
OnTraining = Callable[[int, int, float], None]


def run_paper_suite(
    suite: Suite, progress: OnProgress, training_progress: Callable[[str, str], OnTraining]
) -> Result:
    """Train missing methods, compare, and write `evaluation.json`, `runs.npz` and `tracks.npz`.

    `progress` is called with the number of finished groups of records, and of all; `training_progress` begins
    to show the progress of a named training run, counted in some unit.
    """
    (T,) = suite.sample_time
    test = evaluation_records(suite.data, T)
    knowledge = Knowledge(
        sample_time=T,
        models={ColemanHodgdon.name: suite.reference} if suite.reference else {},
        records=true_records([suite.train], T) if suite.train else (),
        seed=suite.seed,
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
    found = compare(test, methods, suite.protocol(T), progress)
    protocol = {
        **dataclasses.asdict(suite.protocol(T)),
        "records": len(test),
        "phi": PHI,
        "process_variance": list(ActiveModel.process_variance),
        "initial_variance": list(ActiveModel.initial_variance),
        "model": str(suite.model or ""),
        "policies": [str(path) for paths in suite.trained.values() for path in paths],
    }
    write_results(suite, [found], protocol)
    write_publication(suite.out, found.scores, found.tracks, found.rankings, suite.format)
    if not estimate_files:
        return Result(found.scores, found.tracks, len(test))
    folder = suite.out / "estimates"
    folder.mkdir(exist_ok=True)
    variance = DEFAULT_VARIANCE if suite.sensor_variance is None else suite.sensor_variance
    recorded = dataclasses.replace(suite.protocol(T), seeds=1, recorded_variance=variance)
    write_estimates(estimate_files, methods, recorded, folder)
    return Result(found.scores, found.tracks, len(test), f"; estimates in {folder}")


def write_results(
    suite: Suite, found: Sequence[Comparison], protocol: Mapping[str, Any], **more: Any
) -> None:
    """Write `evaluation.json` with more keys, `runs.npz`, and `tracks.npz` of the first sample time."""
    scores = [score for of in found for score in of.scores]
    contents = {
        "protocol": protocol,
        "rows": [score.to_dict() for score in scores],
        "ranks": [ranking.to_dict() for of in found for ranking in of.rankings],
        **more,
        "origin": dict(suite.origin),
    }
    text = json.dumps(contents, indent=2, allow_nan=False) + "\n"
    write_whole(suite.out / "evaluation.json", text)
    save_runs(suite.out / "runs.npz", scores, [squares for of in found for squares in of.squares])
    save_tracks(suite.out / "tracks.npz", found[0].tracks)


def _refuse_what_cannot_run(suite: Suite, knowledge: Knowledge) -> None:
    """Refuse named methods that lack something, before any work; a learned one is trained from records."""
    if knowledge.records and knowledge.models:
        trained = dict.fromkeys(_trained_on_records(suite), (Path(),))
        knowledge = dataclasses.replace(knowledge, trained=trained | dict(knowledge.trained))
    for spec in suite.specs if suite.methods else ():
        if missing := spec.unmet_requirements(knowledge):
            raise InputError(
                f"method {spec.name!r} needs {' and '.join(missing)}; the full suite makes all that it needs"
            )


def _trained_on_records(suite: Suite) -> list[str]:
    return [agent for agent in suite.agents if not find_training(agent).on_twins]


def _train_missing(
    suite: Suite, knowledge: Knowledge, training_progress: Callable[[str, str], OnTraining]
) -> Knowledge:
    """Train the learned methods whose files are not given, into the folder of the results."""
    from rl.trainers import find_trainer, material_of  # what is given needs no torch

    trained = dict(knowledge.trained)
    material = material_of(knowledge)
    for agent in _trained_on_records(suite):
        if agent not in trained:
            trainer = find_trainer(agent)
            options = TrainingOptions(agent=agent, episodes=suite.episodes, seed=suite.seed)
            shown = training_progress(f"train {agent}", trainer.unit)
            trained[agent] = (trainer.run(material, options, suite.out / agent, shown),)
    return dataclasses.replace(knowledge, trained=trained)
