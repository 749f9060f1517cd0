"""Trainings of one method side by side: with several seeds, or a search of its settings.

A learned method is compared fairly only with others whose settings were chosen with as much care. The grid
of a search is small, of the same size for all, and stated (`Trainer.searched`); each of its settings learns a
quarter as long as the real training, with one seed, on twins that are held out. No test record takes part.
"""

import csv
import dataclasses
import io
import itertools
import math
from collections.abc import MutableMapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tabulate import tabulate

from rl.options import LIMITS, TrainingOptions
from rl.trainers import Material, OnProgress, all_trainers, find_trainer
from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.bounds import MOST_TRAININGS
from twin.files.run_folder import CURVE_FILE, read_progress

FOLDER, FILE = "search", "search.csv"  # folder of the trials of a search in its run folder, and their list
_WHOLE = 1000  # progress units of one training
_SECONDS = 0.5  # between two updates of the progress


class TrainingRun(NamedTuple):
    """Training that is one of several."""

    material: Material  # what is learned from
    options: TrainingOptions  # of the training
    folder: Path  # of the run


Shares = MutableMapping[int, tuple[float, float]]
"""Progress of each training from 0 to 1, and its latest mean reward per sample [deg^2], by its place."""


def seeds_from(first: int, count: int) -> range:
    """Return so many seeds from the first on."""
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
    """Train with each seed into a folder of its own; returns the trained files in the order of the seeds.

    Finished trainings are kept, and started ones continue. Workers put their progress into `shares`, a
    `shared_table`; `on_progress` takes thousandths of a training, their number in all and the mean reward
    [deg^2].
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
    """Train each run into its folder; finished trainings are kept, and started ones continue.

    Arguments as in `train_seeds`. The trained files are in the order of the runs.
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
            future.result()  # an error in one training ends all
        finished = {place for future, place in futures.items() if future not in waiting}
        _show(finished, len(runs), shares, on_progress)
    return [future.result() for future in futures]


def _train(run: TrainingRun, place: int, shares: Shares | None) -> Path:
    """Train one of them; it runs in a worker."""

    def show(done: int, total: int, reward: float) -> None:
        if shares is not None:
            shares[place] = done / total, reward

    return find_trainer(run.options.agent).run(run.material, run.options, run.folder, show)


def _show(done: set[int], count: int, shares: Shares | None, on_progress: OnProgress | None) -> None:
    if on_progress is None:
        return
    shown = dict(shares or {})
    parts = [share for place, (share, _) in shown.items() if place not in done]
    rewards = [reward for _, reward in shown.values() if not math.isnan(reward)]
    mean = sum(rewards) / len(rewards) if rewards else math.nan
    on_progress(round(_WHOLE * (len(done) + sum(parts))), _WHOLE * count, mean)


SHORTER = 4  # a trial is shorter than its training by this factor
Settings = dict[str, float]


class SettingsTrial(NamedTuple):
    """Settings that were tried."""

    settings: Settings  # by name
    error_deg2: float  # least typical square error on twins that were held out [deg^2]


def grid_of(agent: str) -> list[Settings]:
    """Return the settings that a search tries."""
    searched = find_trainer(agent).searched
    if not searched:
        others = [name for name, trainer in all_trainers().items() if trainer.searched]
        raise InputError(f"agent {agent!r} has no settings to search; valid: {', '.join(sorted(others))}")
    return [dict(zip(searched, values, strict=True)) for values in itertools.product(*searched.values())]


def search_settings(
    material: Material,
    options: TrainingOptions,
    folder: Path,
    executor: Executor,
    on_progress: OnProgress | None = None,
    shares: Shares | None = None,
) -> list[SettingsTrial]:
    """Try each of the settings and list them in `search.csv`; returns the trials, the best first.

    Finished trials are not repeated; arguments as in `train_seeds`.
    """
    grid = grid_of(options.agent)
    shorter = dataclasses.replace(options, episodes=max(options.episodes // SHORTER, 1))
    runs = [
        TrainingRun(with_settings(material, settings), shorter, folder / _name(settings)) for settings in grid
    ]
    train_side_by_side(runs, executor, on_progress, shares)
    trials = [
        SettingsTrial(settings, float(-np.max(read_progress(run.folder / CURVE_FILE)["return"])))
        for settings, run in zip(grid, runs, strict=True)
    ]
    trials.sort(key=lambda trial: trial.error_deg2)
    write_whole(folder / FILE, _table(trials))
    return trials


def with_settings(material: Material, settings: Settings) -> Material:
    """Return the training material with other settings in place of the method's own."""
    if material.simulated is None:
        raise InputError("settings are searched for trainings on twins alone")
    settings = {**material.simulated.settings, **settings}
    return dataclasses.replace(material, simulated=dataclasses.replace(material.simulated, settings=settings))


def trials_table(trials: Sequence[SettingsTrial]) -> str:
    """Return the trials as a table for a person, the best first."""
    names = [*trials[0].settings, "error on held-out twins [deg]"]
    rows = [[*trial.settings.values(), f"{trial.error_deg2**0.5:.3f}"] for trial in trials]
    return tabulate(rows, names)


def _name(settings: Settings) -> str:
    return "_".join(f"{name}_{value:g}" for name, value in settings.items())


def _table(trials: Sequence[SettingsTrial]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*trials[0].settings, "held_out_error_deg2"])
    writer.writerows([*trial.settings.values(), f"{trial.error_deg2:.6g}"] for trial in trials)
    return text.getvalue()
