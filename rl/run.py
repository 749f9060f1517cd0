"""Configuration of a training run: all that its result depends on, as plain values."""

import dataclasses
from typing import Any

import numpy as np

from rl.trainers import Records
from twin.estimation.active_model import ActiveModel


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
