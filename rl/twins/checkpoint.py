"""Checkpoint of the lesson of the gain: a stopped training goes on, to the numbers of a whole one."""

import dataclasses
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from rl.adam_state import adam_state, begin_moments, fits, set_tensors
from rl.twins.filter_step import FilterStep
from twin.files.state_file import damaged_state, read_state, remove_state, write_state

Array = NDArray[np.float64]
CHECKPOINT = "training of twins"


@dataclasses.dataclass
class Keeper:
    """Keeper of the state of a lesson.

    Attributes:
        path: of the file.
        key: of the run, from `state_key`.
        every: updates between two checkpoints, such that sequences begin anew there.
        step: that learns.
        best: weights that were best on held-out twins so far, by name.
        curve: rows of `progress.csv`, which begin with samples so far and minus the typical square error then
            [deg^2].
        columns: number of what a row holds.
        tables: arrays that the lesson keeps beside, by name; they are filled in their place.
    """

    path: Path
    key: str
    every: int
    step: FilterStep
    best: dict[str, torch.Tensor] = dataclasses.field(default_factory=dict)
    curve: list[tuple[float, ...]] = dataclasses.field(default_factory=list)
    columns: int = 2
    tables: dict[str, Array] = dataclasses.field(default_factory=dict)

    def is_there(self) -> bool:
        """Return whether there is a checkpoint of this run.

        Raises:
            ValueError: the file is foreign or damaged.
        """
        return read_state(self.path, CHECKPOINT, self.key) is not None

    def keep(self, update: int, optimiser: torch.optim.Optimizer, *, last: bool = False) -> None:
        """Write a checkpoint after every so many updates, and after the last one."""
        if update % self.every and not last:
            return
        arrays: dict[str, Array] = {
            "update": np.array([update], dtype=float),
            "curve": np.array(self.curve, dtype=float).reshape(-1, self.columns),
        }
        arrays |= {name: of.numpy() for name, of in self._tensors(optimiser).items()}
        write_state(self.path, CHECKPOINT, self.key, arrays)

    def restore(self, optimiser: torch.optim.Optimizer) -> int:
        """Bring step and optimiser to the checkpoint, and return its update; 0 if there is none.

        Raises:
            ValueError: the file is foreign or damaged.
        """
        begin_moments(self.step, optimiser)
        saved = read_state(self.path, CHECKPOINT, self.key)
        if saved is None:
            return 0
        self.best = {name: of.detach().clone() for name, of in self.step.named_parameters()}
        expected = self._tensors(optimiser)
        damaged = damaged_state(self.path)
        if {"update", "curve"} - set(saved) or not fits(saved, expected):
            raise damaged
        update, curve = saved["update"], saved["curve"]
        if update.shape != (1,) or curve.shape[1:] != (self.columns,):
            raise damaged
        if not (0 < update[0] < 2**31 and float(update[0]).is_integer()):
            raise damaged
        set_tensors(expected, saved)
        self.curve[:] = [tuple(row) for row in curve.tolist()]
        return int(update[0])

    def _tensors(self, optimiser: torch.optim.Optimizer) -> dict[str, torch.Tensor]:
        """Return all that a checkpoint keeps as it is, by name; they share memory with the lesson."""
        best = {name: of.detach() for name, of in self.step.named_parameters()} | self.best
        tables = {f"table {name}": torch.from_numpy(values) for name, values in self.tables.items()}
        return adam_state(self.step, optimiser) | {f"best {name}": of for name, of in best.items()} | tables

    def remove(self) -> None:
        """Remove the checkpoint, if there is one."""
        remove_state(self.path, CHECKPOINT)
