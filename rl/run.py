"""Files of a training run: its configuration, all that the result depends on, and its learning curve."""

import csv
import dataclasses
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from rl.trainers import Records
from twin.estimation.active_model import ActiveModel
from twin.files.atomic import write_whole
from twin.files.run_folder import CURVE_FILE


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


def write_curve(folder: Path, curve: Iterable[tuple[int, float]]) -> None:
    """Write `progress.csv`.

    Args:
        folder: of the run.
        curve: mean reward [deg^2] after so many samples.
    """
    text = io.StringIO()
    rows = ((samples, f"{reward:.6g}") for samples, reward in curve)
    csv.writer(text).writerows([("samples", "mean_reward"), *rows])
    write_whole(folder / CURVE_FILE, text.getvalue())
