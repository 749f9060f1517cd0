"""Checkpoint of the lesson of the gain: a stopped training continues, to the numbers of a complete one."""

import dataclasses
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from rl.run import load_checkpoint, save_checkpoint, unusable
from rl.twins.filter_step import FilterStep

Array = NDArray[np.float64]


@dataclasses.dataclass
class Keeper:
    """Keeper of the state of a lesson.

    Attributes:
        path: of the file.
        key: of the run, from `state_key`.
        every: updates between two checkpoints, such that sequences start again there.
        step: that learns.
        best: weights that were best on held-out twins so far, by name.
        curve: rows of `progress.csv`, which start with samples so far and minus the typical square error then
            [deg^2].
        tables: arrays that the lesson keeps too, by name; they are filled in their place.
    """

    path: Path
    key: str
    every: int
    step: FilterStep
    best: dict[str, torch.Tensor] = dataclasses.field(default_factory=dict)
    curve: list[tuple[float, ...]] = dataclasses.field(default_factory=list)
    tables: dict[str, Array] = dataclasses.field(default_factory=dict)

    def is_there(self) -> bool:
        """Return whether there is a checkpoint of this run; raises `ValueError` for a file that is none."""
        return load_checkpoint(self.path, self.key) is not None

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
        """Bring step and optimiser to the checkpoint, and return its update; 0 if there is none.

        Raises:
            ValueError: the file is no checkpoint, or damaged.
        """
        state = load_checkpoint(self.path, self.key)
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

    def remove(self) -> None:
        """Remove the checkpoint, if there is one."""
        self.path.unlink(missing_ok=True)
