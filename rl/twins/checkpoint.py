"""Checkpoint of the lesson of the gain: a stopped training goes on, to the numbers of a whole one."""

import dataclasses
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from rl.twins.step import TwinsStep
from twin.files.state_file import damaged_state, read_state, remove_state, write_state

Array = NDArray[np.float64]
CHECKPOINT = "training of twins"
CHECKPOINT_FILE = "checkpoint.state"
_MOMENTS = ("exp_avg", "exp_avg_sq")


@dataclasses.dataclass
class Keeper:
    """Keeper of the state of a lesson.

    Attributes:
        path: of the file.
        key: of the run, from `state_key`.
        every: updates between two checkpoints, such that sequences begin anew there.
        step: that learns.
        best: weights that were best on held-out twins so far, by name.
        curve: samples so far, and minus the typical square error then [deg^2].
    """

    path: Path
    key: str
    every: int
    step: TwinsStep
    best: dict[str, torch.Tensor] = dataclasses.field(default_factory=dict)
    curve: list[tuple[int, float]] = dataclasses.field(default_factory=list)

    def is_there(self) -> bool:
        """Return whether there is a checkpoint of this run.

        Raises:
            ValueError: the file is foreign or damaged.
        """
        return read_state(self.path, CHECKPOINT, self.key) is not None

    def keep(self, update: int, optimiser: torch.optim.Optimizer) -> None:
        """Write a checkpoint after every so many updates."""
        if update % self.every:
            return
        arrays: dict[str, Array] = {
            "update": np.array([update], dtype=float),
            "curve": np.array(self.curve, dtype=float).reshape(-1, 2),
        }
        for name, values in self.step.named_parameters():
            arrays[f"weight {name}"] = _numbers(values)
            arrays[f"best {name}"] = _numbers(self.best.get(name, values))
            for moment in _MOMENTS:
                known = optimiser.state.get(values, {}).get(moment, torch.zeros_like(values))
                arrays[f"{moment} {name}"] = _numbers(known)
        write_state(self.path, CHECKPOINT, self.key, arrays)

    def restore(self, optimiser: torch.optim.Optimizer) -> int:
        """Bring step and optimiser to the checkpoint, and return its update; 0 if there is none.

        Raises:
            ValueError: the file is foreign or damaged.
        """
        saved = read_state(self.path, CHECKPOINT, self.key)
        if saved is None:
            return 0
        damaged = damaged_state(self.path)
        parameters = dict(self.step.named_parameters())
        kinds = ("weight", "best", *_MOMENTS)
        shapes = {f"{kind} {name}": tuple(of.shape) for name, of in parameters.items() for kind in kinds}
        shapes |= {"update": (1,)}
        if any(name not in saved or saved[name].shape != shape for name, shape in shapes.items()):
            raise damaged
        update, curve = float(saved["update"][0]), saved.get("curve", np.empty(0))
        if not (0 < update < 2**31 and update.is_integer()) or curve.shape[1:] != (2,):
            raise damaged
        with torch.no_grad():
            for name, values in parameters.items():
                values.copy_(torch.as_tensor(saved[f"weight {name}"]))
                self.best[name] = torch.as_tensor(saved[f"best {name}"], dtype=values.dtype)
                if any(values is of for group in optimiser.param_groups for of in group["params"]):
                    optimiser.state[values] = {"step": torch.tensor(update)} | {
                        moment: torch.as_tensor(saved[f"{moment} {name}"], dtype=values.dtype)
                        for moment in _MOMENTS
                    }
        self.curve[:] = [(int(samples), float(reward)) for samples, reward in curve]
        return int(update)

    def remove(self) -> None:
        """Remove the checkpoint, if there is one."""
        remove_state(self.path, CHECKPOINT)


def _numbers(values: torch.Tensor) -> Array:
    return values.detach().numpy().astype(float)
