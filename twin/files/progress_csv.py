"""Reader of `progress.csv`, the learning curve of a training."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.shown import cut


def read_progress(path: Path) -> dict[str, Any]:
    """Return samples and returns of a training, as its `progress.csv` lists them.

    Raises:
        ValueError: a column is missing, or a line holds no numbers.
    """
    try:
        text = read_limited(path, MEBIBYTE).decode()
        lines = list(csv.DictReader(io.StringIO(text)))
        curve = {
            key: np.array([float(line[name]) for line in lines])
            for key, name in (("samples", "samples"), ("return", "mean_reward"))
        }
    except (csv.Error, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path.parent.name}/{path.name}: {cut(error) or 'a column is missing'}") from error
    if not lines or not np.isfinite(curve["samples"]).all():
        raise InputError(f"{path.parent.name}/{path.name} has no lines of numbers")
    return curve
