"""Files of a training run: its configuration, all that the result depends on, and its learning curve."""

import csv
import dataclasses
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rl.trainers import Records
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import KEY as DEPLOYMENT
from twin.estimation.deployment import prepare_deployment
from twin.files.atomic import write_whole
from twin.files.run_folder import CURVE_FILE
from twin.hysteresis import ColemanHodgdon


def run_configuration(records: Records, active_model: ActiveModel, settings: Any) -> dict[str, Any]:
    """Return the contents of `config.yaml`.

    Args:
        records: of the training set.
        active_model: the filter or model that is learned beside.
        settings: a dataclass of numbers and words.
    """
    return {
        "training": dataclasses.asdict(settings),
        "active_model": active_model.to_dict(),
        "records": {
            "count": len(records),
            "samples": [len(pull) for pull, _ in records],
            "mean_bend_deg": float(np.mean([bend.mean() for _, bend in records])),
        },
    }


def write_curve(
    folder: Path, curve: Iterable[Sequence[float]], columns: Sequence[str] = ("samples", "mean_reward")
) -> None:
    """Write `progress.csv`; what is not known is left empty.

    Args:
        folder: of the run.
        curve: rows, the first two of which are samples and the mean reward [deg^2] then.
        columns: their names.
    """
    text = io.StringIO()
    rows = ([int(row[0]), *("" if np.isnan(value) else f"{value:.6g}" for value in row[1:])] for row in curve)
    csv.writer(text).writerows([columns, *rows])
    write_whole(folder / CURVE_FILE, text.getvalue())


def action_columns(count: int) -> list[str]:
    """Return the names of columns with mean and standard deviation of each action."""
    return [f"action_{number + 1}{part}" for number in range(count) for part in ("", "_deviation")]


def with_deployment(
    configuration: dict[str, Any], records: Records, active_model: ActiveModel, seed: int
) -> dict[str, Any]:
    """Return what a trained file says of itself: its configuration, and what it is deployed with."""
    model = active_model.model
    if not isinstance(model, ColemanHodgdon):
        return configuration
    deployment = prepare_deployment(records, model, active_model.sample_time, seed)
    return {**configuration, DEPLOYMENT: deployment.to_dict()}
