"""Search of the settings of a training on twins: each is tried for a while, on twins that are held out.

A method that learns is compared fairly with those alone whose settings were chosen with as much care. The
grid is small, the same for all in kind and number, and stated (`Trainer.searched`); each of its settings
learns a quarter as long as the real training, with one seed. No test record takes part.
"""

import csv
import dataclasses
import io
import itertools
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tabulate import tabulate

from rl.options import TrainingOptions
from rl.sweep import Shares, TrainingRun, train_side_by_side
from rl.trainers import Material, OnProgress, all_trainers, find_trainer
from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.run_folder import CURVE_FILE, read_progress

FOLDER, FILE = "search", "search.csv"
SHORTER = 4
"""Times that a trial is shorter than the training that it is for."""
Settings = dict[str, float]


class SettingsTrial(NamedTuple):
    """Settings that were tried.

    Attributes:
        settings: by name.
        error_deg2: least typical square error on twins that were held out [deg^2].
    """

    settings: Settings
    error_deg2: float


def grid_of(agent: str) -> list[Settings]:
    """Return the settings that a search tries.

    Raises:
        ValueError: the method has none.
    """
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
    """Try each of the settings, and list them in `search.csv`; finished trials are not made again.

    Args:
        material: what is learned from.
        options: of the training that the search is for; its seed is that of every trial.
        folder: of the search; each trial has a run folder there.
        executor: where they are trained.
        on_progress: told thousandths of a trial done, their number in all, and the mean reward [deg^2].
        shares: where workers tell how far they are.

    Returns:
        The trials, the best first.

    Raises:
        ValueError: the method has no settings to search.
    """
    grid = grid_of(options.agent)
    shorter = dataclasses.replace(options, episodes=max(options.episodes // SHORTER, 1))
    runs = [
        TrainingRun(with_settings(material, settings), shorter, folder / _name(settings)) for settings in grid
    ]
    train_side_by_side(runs, executor, on_progress, shares)
    trials = [
        SettingsTrial(settings, _least_error(run.folder)) for settings, run in zip(grid, runs, strict=True)
    ]
    trials.sort(key=lambda trial: trial.error_deg2)
    write_whole(folder / FILE, _table(trials))
    return trials


def with_settings(material: Material, settings: Settings) -> Material:
    """Return what is learned from, with settings of the training in place of the method's own."""
    if material.simulated is None:
        raise InputError("settings are searched for trainings on twins alone")
    return dataclasses.replace(
        material, simulated=dataclasses.replace(material.simulated, settings=dict(settings))
    )


def trials_table(trials: Sequence[SettingsTrial]) -> str:
    """Return the trials as a table for a person, the best first."""
    names = [*trials[0].settings, "error on held-out twins [deg]"]
    rows = [[*trial.settings.values(), f"{trial.error_deg2**0.5:.3f}"] for trial in trials]
    return tabulate(rows, names)


def _name(settings: Settings) -> str:
    return "_".join(f"{name}_{value:g}" for name, value in settings.items())


def _least_error(folder: Path) -> float:
    return float(-np.max(read_progress(folder / CURVE_FILE)["return"]))


def _table(trials: Sequence[SettingsTrial]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*trials[0].settings, "held_out_error_deg2"])
    writer.writerows([*trial.settings.values(), f"{trial.error_deg2:.6g}"] for trial in trials)
    return text.getvalue()
