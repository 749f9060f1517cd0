"""Knowledge of methods before the test: identified models, training records, fits, trained files."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from twin.estimation.task import TrainingTask, stack_records
from twin.hysteresis import ColemanHodgdon, HysteresisModel

if TYPE_CHECKING:
    from twin.preset.preset import Preset
    from twin.preset.randomization import Ranges

Array = NDArray[np.float64]
Record = tuple[Array, Array]
"""`(pull_mm (N,), bend_deg (N,))` of a training record, with its true angle."""


class TrainingFit(Protocol):
    """Numbers that are found on the training records, once for all methods that use them."""

    @property
    def key(self) -> str:
        """Its name in the file of fits."""

    def find(self, knowledge: "Knowledge") -> dict[str, Any]:
        """Return the numbers, as JSON can hold them; it runs in a worker process."""


@dataclasses.dataclass(frozen=True)
class Knowledge:
    """Knowledge before the test, at one sample time.

    Attributes:
        sample_time: T [s].
        models: identified models of hysteresis, by name.
        records: training records at this sample time; empty where there are none.
        seed: of what is drawn for fits.
        fits: what each `TrainingFit` has found, by its key.
        trained: files of each trained agent, one for each training of it.
        training: place among them, or among the ensembles, of the one that a method is built from.
        ensembles: files of twins along the test's commands, of each ensemble: all of other twins, so that
            they differ by what one of them is uncertain by.
        smallest_wire_offset: that a twin may have [m].
        twins: preset and ranges of twins that may be simulated for a training.
    """

    sample_time: float
    models: Mapping[str, HysteresisModel]
    records: Sequence[Record] = ()
    seed: int = 0
    fits: Mapping[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    trained: Mapping[str, tuple[Path, ...]] = dataclasses.field(default_factory=dict)
    training: int = 0
    ensembles: tuple[tuple[Path, ...], ...] = ()
    smallest_wire_offset: float | None = None
    twins: "tuple[Preset, Ranges] | None" = None

    @property
    def reference(self) -> HysteresisModel:
        """The paper's reference model, of Coleman and Hodgdon."""
        return self.models[ColemanHodgdon.name]

    @property
    def task(self) -> TrainingTask:
        """The training records under the paper's training noise."""
        return TrainingTask(*stack_records(self.records))

    def file_of(self, agent: str) -> Path:
        """Return the trained file of an agent that a method is built from."""
        return self.trained[agent][self.training]

    @property
    def ensemble_files(self) -> tuple[Path, ...]:
        """Files of the ensemble that a method is built from."""
        return self.ensembles[self.training]

    def found(self, fit: TrainingFit) -> dict[str, Any]:
        """Return what a fit has found, or find it now."""
        return self.fits[fit.key] if fit.key in self.fits else fit.find(self)
