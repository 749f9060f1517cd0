"""Files of a training run: configuration, learning curve and checkpoint."""

import csv
import dataclasses
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.trainers import Records
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import KEY as DEPLOYMENT
from twin.estimation.deployment import prepare_deployment
from twin.files.atomic import write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.run_folder import CURVE_FILE
from twin.hysteresis import ColemanHodgdon

LARGEST = 256 * MEBIBYTE  # size of a checkpoint at most [bytes]
_MARK = "endotwin checkpoint"


def run_configuration(records: Records, active_model: ActiveModel, settings: Any) -> dict[str, Any]:
    """Return the contents of `config.yaml`: all that the result depends on; settings are a dataclass."""
    return {
        "training": json.loads(json.dumps(dataclasses.asdict(settings))),  # tuples as lists
        "active_model": active_model.to_dict(),
        "records": {
            "count": len(records),
            "samples": [len(pull) for pull, _ in records],
            "mean_bend_deg": float(np.mean([bend.mean() for _, bend in records])),
        },
    }


def with_deployment(
    configuration: dict[str, Any], records: Records, active_model: ActiveModel, seed: int
) -> dict[str, Any]:
    """Return the description in a trained file: its configuration, and what it is deployed with."""
    model = active_model.model
    if not isinstance(model, ColemanHodgdon):
        return configuration
    deployment = prepare_deployment(records, model, active_model.sample_time, seed)
    return {**configuration, DEPLOYMENT: deployment.to_dict()}


def write_curve(
    folder: Path, curve: Iterable[Sequence[float]], columns: Sequence[str] = ("samples", "mean_reward")
) -> None:
    """Write `progress.csv`; the first columns are samples and the mean reward [deg^2], NaN is left empty."""
    text = io.StringIO()
    rows = ([int(row[0]), *("" if np.isnan(value) else f"{value:.6g}" for value in row[1:])] for row in curve)
    csv.writer(text).writerows([columns, *rows])
    write_whole(folder / CURVE_FILE, text.getvalue())


def action_columns(count: int) -> list[str]:
    """Return the names of columns with mean and standard deviation of each action."""
    return [f"action_{number + 1}{part}" for number in range(count) for part in ("", "_deviation")]


def save_checkpoint(path: Path, key: str, state: dict[str, Any]) -> None:
    """Write tensors, numbers, texts, and lists and dictionaries of them, for the run of a key."""
    buffer = io.BytesIO()
    torch.save({_MARK: key, "state": state}, buffer)
    write_whole(path, buffer.getvalue())


def load_checkpoint(path: Path, key: str) -> dict[str, Any] | None:
    """Return the state of a checkpoint; None if there is none, or one of another run. Unpickles nothing."""
    if not path.exists():
        return None
    try:
        saved = torch.load(io.BytesIO(read_limited(path, LARGEST)), weights_only=True)
        found, state = saved[_MARK], saved["state"]
    except Exception as error:  # zipfile's, pickle's and torch's own classes
        raise unusable(path) from error
    return dict(state) if found == key else None


def unusable(path: Path) -> InputError:
    """Return the error for a file that is no checkpoint, or whose contents do not fit the training."""
    return InputError(f"{path} is no checkpoint of this training, or damaged: remove it to start again")


class Keeper:
    """Checkpoint of the state of a lesson.

    Attributes:
        saved: state in an existing checkpoint of this run, or None.
        best: weights that were best on held-out twins so far, by name.
        curve: rows of `progress.csv`, which start with samples so far and minus the typical square error then
            [deg^2].
        tables: arrays that the lesson keeps too, by name; they are filled in their place.
    """

    def __init__(self, path: Path, key: str, every: int, step: torch.nn.Module):
        """Read the checkpoint of a run; one is written after `every` updates, when sequences start again."""
        self.path, self.key, self.every, self.step = path, key, every, step
        self.saved = load_checkpoint(path, key)
        self.best: dict[str, torch.Tensor] = {}
        self.curve: list[tuple[float, ...]] = []
        self.tables: dict[str, NDArray[np.float64]] = {}

    def keep(self, update: int, optimiser: torch.optim.Optimizer, *, last: bool = False) -> None:
        """Write a checkpoint after every so many updates, and after the last one."""
        if update % self.every and not last:
            return
        state = {
            "update": update,
            "curve": self.curve,
            "step": self.step.state_dict(),
            "optimiser": optimiser.state_dict(),
            "best": self.best,
            "tables": {name: torch.from_numpy(values) for name, values in self.tables.items()},
        }
        save_checkpoint(self.path, self.key, state)

    def restore(self, optimiser: torch.optim.Optimizer) -> int:
        """Restore step and optimiser from the checkpoint and return its update; 0 if there is none."""
        state, self.saved = self.saved, None
        if state is None:
            return 0
        try:
            self.step.load_state_dict(state["step"])
            optimiser.load_state_dict(state["optimiser"])
            for name, values in self.tables.items():
                values[...] = state["tables"][name].numpy()
            self.best, self.curve[:] = state["best"], state["curve"]
            return int(state["update"])
        except Exception as error:  # what does not fit, in classes of torch
            raise unusable(self.path) from error
