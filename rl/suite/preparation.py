"""Preparation of the full benchmark: training records, models, fits, trained methods, ensembles."""

import dataclasses
from collections.abc import Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any

from rl.options import TRAINING_STROKE_MM, TrainingOptions
from rl.suite.settings import PAPER_SAMPLE_TIME, FullSuite, NewProgress, OnProgress
from rl.sweep import folder_of
from rl.trainers import Trainer, find_trainer, material_of
from twin.dataset.recipe import Recipe
from twin.dataset.write import write_dataset
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_training, needed_fits, trainings
from twin.evaluation.reading import read_episodes, true_records, whole_pieces
from twin.preset import Preset, Ranges
from twin.suite.fitting import identify_models, load_fits, save_fits
from twin.suite.limit import make_ensembles
from twin.suite.scenarios import SAMPLE_TIME


def training_records(suite: FullSuite, preset: Preset, executor: Executor, progress: NewProgress) -> Path:
    """Simulate five records on the paper's training stroke, one of each kind of signal."""
    folder = suite.folder / "train"
    if not (folder / "dataset.json").is_file():
        recipe = Recipe(preset, (TRAINING_STROKE_MM,), seconds=suite.seconds, seeds=(suite.seed,))
        shown = progress("training records", "ep")
        write_dataset(recipe, folder, executor, workers=suite.workers, on_progress=shown)
    return folder


def learn(
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
        twins=(preset, ranges),
    )
    missing = [fit for fit in needed_fits(suite.specs) if fit.key not in knowledge.fits]
    if missing:
        jobs = {fit.key: executor.submit(fit.find, knowledge) for fit in missing}
        wait_for(list(jobs.values()), progress(f"tune T = {T:g} s", "filter"))
        fits = {**knowledge.fits, **{key: job.result() for key, job in jobs.items()}}
        save_fits(path, fits)
        knowledge = dataclasses.replace(knowledge, fits=fits)
    trained = {
        # What is trained on twins is told T: one serves all sample times.
        agent: _files(suite, (suite.folder if training.on_twins else folder) / agent, training.file)
        for agent, training in trainings().items()
        if agent in agents_of(suite)
    }
    return dataclasses.replace(knowledge, trained=trained | suite.trained)


def _files(suite: FullSuite, folder: Path, name: str) -> tuple[Path, ...]:
    """Return the files of the trainings of an agent: that with the suite's seed is in its own folder."""
    further = range(suite.seed + 1, suite.seed + suite.trainings)
    return (folder / name, *(folder_of(folder, seed) / name for seed in further))


def agents_of(suite: FullSuite) -> list[str]:
    """Agents that the compared methods run on, each once."""
    return list(dict.fromkeys(spec.agent for spec in suite.specs if spec.agent is not None))


def agents_to_train(suite: FullSuite) -> list[str]:
    """Those of them whose files are not given."""
    return [agent for agent in agents_of(suite) if agent not in suite.trained]


def train_all(
    suite: FullSuite, known: Sequence[Knowledge], executor: Executor, progress: NewProgress
) -> None:
    """Train every learned method that is not given, at every sample time, on as many samples at each."""
    # PPO takes longest: what begins last would leave the other workers idle.
    agents = sorted(agents_to_train(suite), key=lambda agent: not find_trainer(agent).counts_samples)
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
        wait_for(jobs, progress("train", "training"))


def train_one(agent: str, knowledge: Knowledge, episodes: int, seed: int) -> None:
    """Train one method under the strict protocol; a finished one is left as it is. It runs in a worker."""
    trainer = find_trainer(agent)
    count = episodes_at(trainer, episodes, knowledge.sample_time)
    options = TrainingOptions(agent=agent, episodes=count, seed=seed)
    trainer.run(material_of(knowledge), options, knowledge.file_of(agent).parent)


def episodes_at(trainer: Trainer, episodes: int, sample_time: float) -> int:
    """Return the episodes that are as many samples at a sample time [s] as some are at the paper's."""
    share = sample_time / PAPER_SAMPLE_TIME if trainer.counts_samples else 1.0
    return max(round(episodes * share), 1)


def ensembles_along(
    suite: FullSuite, data: Sequence[Path], preset: Preset, ranges: Ranges, progress: NewProgress
) -> tuple[tuple[Path, ...], ...]:
    """Simulate ensembles along the commands of the test, where a method needs them: of other twins, each."""
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


def wait_for(futures: Sequence[Any], progress: OnProgress) -> None:
    """Wait for all of some futures, and show how many are done."""
    progress(0, len(futures))
    for done, future in enumerate(as_completed(futures), start=1):
        future.result()
        progress(done, len(futures))
