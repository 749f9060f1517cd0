"""Trained files that are given to a comparison, by agent; each is checked to be for it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.registry import find_training
from twin.hysteresis import ColemanHodgdon


def given_files(
    paths: Sequence[Path], model: ColemanHodgdon | None, sample_times: Sequence[float]
) -> dict[str, Path]:
    """Return trained files by agent, and refuse one that was trained for something else.

    Args:
        paths: of the files.
        model: that an estimator runs beside, unless it brings its own.
        sample_times: T at which it is to run [s].

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: two are of one agent, one is of another sample time, or was trained beside another filter.
    """
    files: dict[str, Path] = {}
    for path in paths:
        agent = read_trained_file(path).agent
        training = find_training(agent)
        if agent in files:
            raise InputError(f"{path}: a second policy of the agent {agent!r}")
        estimator: Any = training.load(path)
        for sample_time in sample_times:
            if training.on_twins:
                estimator.at(sample_time)  # it is told T, which its twins must be able to follow
                continue
            trained_at = float(estimator.sample_time)
            if abs(trained_at - sample_time) > 1e-9:
                raise InputError(
                    f"the {agent} policy was trained at T = {trained_at:g} s, not at {sample_time:g} s"
                )
        if training.same_filter:
            if model is None:
                raise InputError(
                    f"{path} runs beside the model that it was trained with; the full suite identifies its "
                    f"own, and trains {agent} itself"
                )
            beside = estimator.active_model
            here = ActiveModel(model, sample_times[0], measurement_variance=beside.measurement_variance)
            if beside != here:
                raise InputError(f"{path} was trained beside another model or filter than the one given")
        files[agent] = path
    return files
