"""Trained files that are given to a comparison, by agent, checked to fit it.

Several files of one agent are training runs of one method that differ only in their seed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.registry import find_training
from twin.files.bounds import MOST_TRAININGS
from twin.files.run_folder import read_cost
from twin.files.shown import cut, shown
from twin.hysteresis import ColemanHodgdon

_OF_SEED = ("members", "model", "deployment", "reference")
"""Parts of a file that depend on the seed, besides the network."""


def given_files(
    paths: Sequence[Path], model: ColemanHodgdon | None, sample_times: Sequence[float]
) -> dict[str, tuple[Path, ...]]:
    """Return trained files by agent, and refuse one that was trained for something else.

    Raises `ValueError` where two of one agent differ in more than their seed, one is of another sample time
    or filter than the comparison, or a `cost.json` is damaged.
    """
    files: dict[str, tuple[Path, ...]] = {}
    first: dict[str, TrainedFile] = {}
    seeds: set[tuple[str, Any]] = set()
    for path in paths:
        file = read_trained_file(path)
        agent, training = file.agent, find_training(file.agent)
        difference = _differences(first.setdefault(agent, file), file)
        if difference:
            names = cut(", ".join(difference))
            raise InputError(f"{path} is no other training of {files[agent][0]}: they differ in {names}")
        seed = _settings(file).get("seed")
        if (agent, seed) in seeds:
            raise InputError(f"{path}: a second policy of the agent {agent!r} and the seed {shown(seed)}")
        seeds.add((agent, seed))
        if len(files.get(agent, ())) >= MOST_TRAININGS:
            raise InputError(f"{path}: more than {MOST_TRAININGS} policies of the agent {agent!r}")
        estimator: Any = training.load(file)
        read_cost(path.parent)  # refuses a mistake now, not after the training of others
        for sample_time in sample_times:
            if training.on_twins:
                estimator.at(sample_time)  # its twins must be able to follow T
                continue
            trained_at = float(estimator.sample_time)
            if abs(trained_at - sample_time) > 1e-9:
                raise InputError(
                    f"the {agent} policy was trained at T = {trained_at:g} s, not at {sample_time:g} s"
                )
        if training.same_filter:
            if model is None:
                raise InputError(
                    f"{path} runs with the model that it was trained with; the full suite identifies its "
                    f"own, and trains {agent} itself"
                )
            own = ActiveModel.from_dict(file.description.get("active_model"))
            here = ActiveModel(model, sample_times[0], measurement_variance=own.measurement_variance)
            if own != here:
                raise InputError(f"{path} was trained with another model or filter than the one given")
        files[agent] = (*files.get(agent, ()), path)
    return files


def _settings(file: TrainedFile) -> dict[str, Any]:
    settings = file.description.get("training")
    return settings if isinstance(settings, dict) else {}


def _differences(one: TrainedFile, other: TrainedFile) -> list[str]:
    def facts(file: TrainedFile) -> dict[str, Any]:
        of_run = {name: of for name, of in file.description.items() if name not in (*_OF_SEED, "training")}
        return of_run | {name: of for name, of in _settings(file).items() if name != "seed"}

    ours, theirs = facts(one), facts(other)
    return [name for name in dict.fromkeys([*ours, *theirs]) if ours.get(name) != theirs.get(name)]
