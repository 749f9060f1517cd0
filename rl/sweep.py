"""Trainings of one method side by side: with several seeds, or with several settings."""

import dataclasses
import math
from collections.abc import MutableMapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from typing import NamedTuple

from rl.options import LIMITS, TrainingOptions
from rl.trainers import Material, OnProgress, find_trainer
from twin.errors import InputError
from twin.evaluation.score import MOST_TRAININGS

_WHOLE = 1000  # what one training counts in progress
_SECONDS = 0.5  # between two looks at it


class TrainingRun(NamedTuple):
    """Training that is one of several.

    Attributes:
        material: what is learned from.
        options: of the training.
        folder: of the run.
    """

    material: Material
    options: TrainingOptions
    folder: Path


class Share(NamedTuple):
    """Progress of one training.

    Attributes:
        done: of it, from 0 to 1.
        reward: latest mean reward per sample [deg^2].
    """

    done: float
    reward: float


Shares = MutableMapping[int, Share]
"""Progress of each training, by its place among them."""


def seeds_from(first: int, count: int) -> range:
    """Return so many seeds from the first on.

    Raises:
        ValueError: there are none, too many, or they end beyond the largest seed.
    """
    most = LIMITS["seed"][1]
    if not 1 <= count <= MOST_TRAININGS:
        raise InputError(f"seeds = {count}: must be at least 1 and at most {MOST_TRAININGS}")
    if first + count - 1 > most:
        raise InputError(f"seed = {first}: with {count} seeds it must be at most {most - count + 1}")
    return range(first, first + count)


def folder_of(folder: Path, seed: int) -> Path:
    """Return the run folder of one seed."""
    return folder / f"seed_{seed}"


def train_seeds(
    material: Material,
    options: TrainingOptions,
    seeds: Sequence[int],
    folder: Path,
    executor: Executor,
    on_progress: OnProgress | None = None,
    shares: Shares | None = None,
) -> list[Path]:
    """Train with each seed into a folder of its own; what is finished or begun there is taken up.

    Args:
        material: what is learned from.
        options: of all trainings but for the seed.
        seeds: one for each training.
        folder: of the run folders.
        executor: where they are trained.
        on_progress: told thousandths of a training done, their number in all, and the mean reward per sample
            over those that are under way [deg^2].
        shares: where workers tell how far they are; a `shared_table`. Without it, finished ones count.

    Returns:
        The trained files, in the order of the seeds.
    """
    runs = [
        TrainingRun(material, dataclasses.replace(options, seed=seed), folder_of(folder, seed))
        for seed in seeds
    ]
    return train_side_by_side(runs, executor, on_progress, shares)


def train_side_by_side(
    runs: Sequence[TrainingRun],
    executor: Executor,
    on_progress: OnProgress | None = None,
    shares: Shares | None = None,
) -> list[Path]:
    """Train each run into its folder; what is finished or begun there is taken up.

    Arguments as of `train_seeds`. The trained files are in the order of the runs.
    """
    if shares is not None:
        shares.clear()
    futures: dict[Future[Path], int] = {
        executor.submit(_train, run, place, shares): place for place, run in enumerate(runs)
    }
    waiting = set(futures)
    pause = None if shares is None else _SECONDS
    while waiting:
        done, waiting = wait(waiting, timeout=pause, return_when=FIRST_COMPLETED)
        for future in done:
            future.result()  # what one of them could not do ends all
        finished = {place for future, place in futures.items() if future not in waiting}
        _show(finished, len(runs), shares, on_progress)
    return [future.result() for future in futures]


def _train(run: TrainingRun, place: int, shares: Shares | None) -> Path:
    """Train one of them; it runs in a worker."""

    def show(done: int, total: int, reward: float) -> None:
        if shares is not None:
            shares[place] = Share(done / total, reward)

    return find_trainer(run.options.agent).run(run.material, run.options, run.folder, show)


def _show(done: set[int], count: int, shares: Shares | None, on_progress: OnProgress | None) -> None:
    if on_progress is None:
        return
    told = dict(shares or {})
    parts = [share.done for place, share in told.items() if place not in done]
    rewards = [share.reward for share in told.values() if not math.isnan(share.reward)]
    mean = sum(rewards) / len(rewards) if rewards else math.nan
    on_progress(round(_WHOLE * (len(done) + sum(parts))), _WHOLE * count, mean)
