"""Identified models and fits of the full comparison: found once on the training records, and kept."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError
from twin.estimation.open_loop import MONOTONE
from twin.files.atomic import write_whole
from twin.files.json_text import read_json
from twin.hysteresis import (
    BoucWen,
    ColemanHodgdon,
    HysteresisModel,
    IdentifiedModel,
    PrandtlIshlinskii,
    load_model,
)
from twin.identification import OPTIMIZERS, identify

Array = NDArray[np.float64]
Records = Sequence[tuple[Array, Array]]
Fits = dict[str, dict[str, Any]]  # numbers of each fit, by its key

POPULATION, GENERATIONS = 80, 150  # of the genetic algorithm
MODEL_NAMES = (ColemanHodgdon.name, MONOTONE, BoucWen.name, PrandtlIshlinskii.name)


def identify_models(
    measured: Records, folder: Path, seed: int, on_progress: Callable[[int, int], None] = lambda *_: None
) -> dict[str, HysteresisModel]:
    """Identify each model on `(pull_mm, measured_deg)` of training records, or read that of an earlier run.

    They are kept in the folder, as `endotwin identify` writes them; `on_progress` is called with the number
    of finished models, and of all.
    """
    models = {}
    for count, name in enumerate(MODEL_NAMES, start=1):
        path = folder / f"{name.replace(', ', '_').replace('-', '_')}.json"
        if not path.is_file():
            monotone = name == MONOTONE
            kind = ColemanHodgdon.name if monotone else name
            size: dict[str, Any] = {"population": POPULATION, "generations": GENERATIONS}
            model, rmse = identify(measured, seed, kind, monotone=monotone, **size)
            how = OPTIMIZERS[kind].format(**size)
            found = IdentifiedModel(model, rmse, how, seed, "training records")
            write_whole(path, json.dumps(in_single_precision(found.to_dict()), indent=2) + "\n")
        models[name] = load_model(path)
        on_progress(count, len(MODEL_NAMES))
    return models


def in_single_precision(values: Any) -> Any:
    """Return dicts and lists with their floating-point numbers rounded to single precision.

    The last digits that an optimiser finds depend on the processor. A particle filter makes other draws for
    them, and its error then differs by tenths of a degree.
    """
    if isinstance(values, dict):
        return {name: in_single_precision(value) for name, value in values.items()}
    if isinstance(values, list | tuple):
        return [in_single_precision(value) for value in values]
    return float(np.float32(values)) if isinstance(values, float) else values


def load_fits(path: Path) -> Fits:
    """Read the numbers of all fits; none, where there is no file."""
    try:
        fits = read_json(path)
        if all(isinstance(found, dict) for found in fits.values()):
            return fits
    except MissingFileError:
        return {}
    except ValueError:
        pass
    raise InputError(f"{path} is damaged: remove it, and it is made again")
