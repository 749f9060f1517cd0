"""Knowledge of methods: what is known before the test (`Knowledge`), and measurements under test (`Case`)."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Sensor
from twin.hysteresis import ColemanHodgdon, HysteresisModel
from twin.signals.noise import draw_noise

if TYPE_CHECKING:
    from twin.preset.preset import Preset
    from twin.preset.randomization import Ranges

Array = NDArray[np.float64]
TrainingRecord = tuple[Array, Array]  # `(pull_mm (N,), truth_deg (N,))` of a training record


@dataclasses.dataclass(frozen=True)
class TrainingTask:
    """Training records of equal length, and what is drawn for every trial."""

    pull_mm: Array  # (records, N) pulling distance [mm]
    bend_deg: Array  # (records, N) true bending angle, for measurements and rewards, never observed [deg]
    noise: str = "gaussian"  # kind of the measurement noise
    noise_level: float = 0.1  # its level: the paper trains at R = 0.1
    initial_error_deg: float = 20.0  # largest error of the initial estimate, evenly drawn [deg]

    def draw(
        self, count: int, rng: np.random.Generator, first: NDArray[np.int64] | int = 0
    ) -> tuple[NDArray[np.int64], Array, Array]:
        """Draw episodes: (count,) records, (count, N) measurements and (count,) initial estimates [deg].

        The estimates are of the angle at the first sample of each episode, (count,) or the same for all.
        """
        record = rng.integers(len(self.pull_mm), size=count)
        truth = self.bend_deg[record]
        measurement = truth + draw_noise(self.noise, self.noise_level, truth.shape, rng)
        error = rng.uniform(-self.initial_error_deg, self.initial_error_deg, size=count)
        initial = truth[np.arange(count), first] + error
        return record, measurement, initial


def stack_records(records: Sequence[TrainingRecord]) -> tuple[Array, Array]:
    """Cut records to the shortest and stack them: (records, N) pulls [mm] and true angles [deg]."""
    samples = min(len(pull) for pull, _ in records)
    pulls, bends = zip(*((pull[:samples], bend[:samples]) for pull, bend in records), strict=True)
    return np.stack(pulls), np.stack(bends)


class TrainingFit(Protocol):
    """Numbers fitted to the training records, once for all methods that use them."""

    @property
    def key(self) -> str:
        """Its name in the file of fits."""

    def find(self, knowledge: "Knowledge") -> dict[str, Any]:
        """Return the numbers, as JSON can hold them; it runs in a worker process."""


@dataclasses.dataclass(frozen=True)
class Knowledge:
    """Knowledge before the test, at one sample time."""

    sample_time: float  # T [s]
    models: Mapping[str, HysteresisModel]  # identified models of hysteresis, by name
    records: Sequence[TrainingRecord] = ()  # training records at this sample time; may be empty
    seed: int = 0  # of what is drawn for fits
    # result of each `TrainingFit`, by its key
    fits: Mapping[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    # files of each trained agent, one for each training run
    trained: Mapping[str, tuple[Path, ...]] = dataclasses.field(default_factory=dict)
    training: int = 0  # index of the training run, or of the ensemble, that a method is built from
    # files of twins along the test's commands, of each ensemble; no twin is in two of them
    ensembles: tuple[tuple[Path, ...], ...] = ()
    smallest_wire_offset: float | None = None  # that a twin may have [m]
    # preset and ranges of twins that may be simulated for a training run
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
        """Return the numbers of a fit, found now if they are not known."""
        return self.fits[fit.key] if fit.key in self.fits else fit.find(self)


@dataclasses.dataclass(frozen=True)
class Case:
    """B runs over records, each with its own measurements."""

    pull_mm: Array  # (B, N) commanded pulling distance [mm]
    measurement_deg: Array  # (B, N) measured bending angle, NaN where there is none [deg]
    initial_bend_deg: Array  # (B,) initial estimate, wrong on purpose [deg]
    sensor: Sensor  # variance and largest magnitude of each run's noise, known to the filters
    # (B,) kind and level of each run's noise: only for the limit, which knows all of it
    noises: tuple[tuple[str, float], ...] = ()
    truth_deg: Array | None = None  # (B, N) true angle, given only to oracles [deg]
    from_rest: bool = True  # whether all runs begin at rest; else nothing is known of their history


CaseEstimator = Callable[[Case], Array]  # returns (B, N) estimated angles [deg] of a case


@runtime_checkable
class IntervalEstimator(Protocol):
    """An estimator of a case that may also state intervals."""

    def with_interval(self, case: Case) -> tuple[Array, Array | None]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg], or None."""
