"""Settings of a comparison, as `endotwin evaluate` takes them, and the suite that is resolved from them."""

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from rl.options import LIMITS, TrainingOptions
from twin.errors import InputError
from twin.estimation.methods import Presentation
from twin.estimation.registry import MethodSpec, find_method, method_specs
from twin.evaluation.protocol import RECORD_SAMPLE_TIME, SEALED, Condition, Protocol
from twin.files.bounds import LONGEST_SECONDS, MOST_TRAININGS, MOST_WORKERS, check_between
from twin.preset.preset import ZERO_DEVIATION_DEG

if TYPE_CHECKING:
    from twin.episode import Record
    from twin.evaluation.score import Score
    from twin.hysteresis import ColemanHodgdon

Format = Literal["png", "pdf", "svg"]
EVERY = ("all",)  # value of `methods` for every method
MOST_MEMBERS, MOST_ENSEMBLES = 10_000, 100


@dataclasses.dataclass(frozen=True)
class Settings:
    """Settings of a comparison."""

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Test set: folders of MCAP files, or files. The full suite simulates its own without them."""
    out: Path
    """Folder for evaluation.json, tables, figures and tracks."""
    model: Path | None = None
    """Reference model, as `endotwin identify` writes it; if not given, coleman_hodgdon.json, or the model
    that the first policy was trained with. The full suite identifies its own."""
    train: Path | None = None
    """Training set, to train what is not given and to tune the yardsticks."""
    suite: str = "paper"
    """paper: its five noises, and the Poisson ones with dither; paper-only: its five; full; untrained: as
    full, with faults of the sensor and twins that are in no training; sealed: 200 conditions from broad
    distributions, drawn by a hash of the given files and --seed."""
    policy: tuple[Path, ...] = ()
    """Trained files of any method, as `endotwin train` writes them: policy.onnx, lstm.onnx ... One that was
    trained at one sample time runs only at that one (--sample-time). Files of one method that differ only in
    their seed are one row: their mean and spread."""
    methods: tuple[str, ...] = ()
    """Names of the methods to compare, as in the tables; all of the suite, if not given. In the full suite,
    `all` adds those that run only on request, and trains what is not given."""
    method_file: tuple[Path, ...] = ()
    """Python files that register your own estimators (`register_method`) for the comparison; each is
    executed."""
    measurements: Literal["auto", "drawn", "recorded"] = "auto"
    """drawn: the truth with drawn noise; recorded: the record's own measurements, once. auto: recorded if all
    records are measured logs, else drawn; always drawn in the full suite."""
    sensor_variance: float | None = None
    """R of recorded measurements [deg^2]; if not given, as the records state it, else 0.1."""
    sensor_zero_deviation_deg: float | None = None
    """Standard deviation of the zero of recorded measurements [deg]; 0: calibrated. If not given, 2."""
    write_estimates: bool = False
    """Also write each record into OUT/estimates, with the estimates of all methods from its recorded
    measurements as /estimate/METHOD."""
    seeds: int | None = None
    """Draws of each noise: 20, and 4 in each of the sealed conditions."""
    sample_time: tuple[float, ...] = ()
    """T [s]; records are thinned to it. Without it, 0.1, and in the full suite 0.1 and 0.02."""
    initial_error_deg: float = 20.0
    """Error of the initial estimate [deg]."""
    episodes: int = TrainingOptions.episodes
    """Episodes of PPO for a policy that is not given."""
    preset: str = "ureteroscope"
    """Endoscope of records and ensembles, and the ranges that they are drawn from."""
    trainings: int = 1
    """Trainings of each learned method that is not given, with --seed and the seeds after it; a row is their
    mean, with the spread."""
    members: int | None = None
    """Twins in an ensemble: 256, in the sealed suite 64."""
    ensembles: int = 1
    """Ensembles, each of other twins; a row is their mean, with the spread."""
    member_physics: Literal["reduced", "mujoco"] = "reduced"
    """Physics of these twins; records are always simulated in MuJoCo."""
    seconds: float = 60.0
    """Length of the simulated records [s]."""
    workers: int = 0
    """Processes; 0 for one per core. The results do not depend on it."""
    dask: str | None = None
    """Dask scheduler whose workers compute; they need all files under the same path."""
    format: tuple[Format, ...] = ("png",)
    """Formats of the figures. Each figure is drawn over the page (7.2 inches) and in a column of a paper (3.5
    inches, NAME_column); tables.tex and methods.bib are for LaTeX."""
    seed: int = 0
    """Seed of all random numbers."""
    json: bool = False
    """Print the summary as one JSON object."""

    @property
    def is_full(self) -> bool:
        """Whether missing records, models and ensembles are made."""
        return self.suite in ("full", "untrained", SEALED)

    @property
    def is_sealed(self) -> bool:
        """Whether the conditions are drawn by the files under test."""
        return self.suite == SEALED

    @property
    def draws(self) -> int:
        """Draws of each noise."""
        return (4 if self.is_sealed else 20) if self.seeds is None else self.seeds

    @property
    def count_of_members(self) -> int:
        """Twins in an ensemble."""
        return (64 if self.is_sealed else 256) if self.members is None else self.members


@dataclasses.dataclass(frozen=True)
class Suite(Settings):
    """A comparison with all that its settings refer to."""

    # trained files of each given agent, one for each training run of it
    trained: dict[str, tuple[Path, ...]] = dataclasses.field(default_factory=dict)
    # reference model of the paper's suite; without it, only methods that need none are compared
    reference: "ColemanHodgdon | None" = None
    # R of recorded measurements, where they are used instead of drawn noise [deg^2]
    recorded_variance: float | None = None
    # command, versions and hashes of the data, for `evaluation.json`
    origin: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for T in self.sample_time:
            self.protocol(T)
            steps = T / RECORD_SAMPLE_TIME
            if self.is_full and (steps < 1 or abs(steps - round(steps)) > 1e-9):
                raise InputError(f"sample_time = {T:g} s: must be a multiple of {RECORD_SAMPLE_TIME:g} s")
        check_between("members", self.count_of_members, 8, MOST_MEMBERS)
        check_between("ensembles", self.ensembles, 1, MOST_ENSEMBLES)
        check_between("seconds", self.seconds, 5, LONGEST_SECONDS, "s")
        check_between("episodes", self.episodes, *LIMITS["episodes"])
        check_between("trainings", self.trainings, 1, MOST_TRAININGS)
        check_between("workers", self.workers, 1, MOST_WORKERS)
        if self.is_full and self.train and os.path.realpath(self.train) in map(os.path.realpath, self.data):
            raise InputError(
                f"training set {self.train} is test data too: what is trained there proves nothing"
            )
        for name in () if self.methods == EVERY and self.is_full else self.methods:
            find_method(name)

    @property
    def specs(self) -> list[MethodSpec]:
        """Methods to compare, in the order of tables: those that are named, or of the suite or a given file.

        The density of a recorded noise, or of a faulty sensor, is unknown.
        """
        specs = method_specs()
        if self.methods and not (self.methods == EVERY and self.is_full):
            specs = [spec for spec in specs if spec.name in self.methods]
        elif not self.methods:
            specs = [spec for spec in specs if self._has(spec.presentation) or spec.agent in self.trained]
        no_density = self.is_full and (self.recorded_variance is not None or self.suite != "full")
        return [spec for spec in specs if not (no_density and spec.needs_density)]

    def _has(self, of: Presentation) -> bool:
        if self.is_sealed:
            return of.in_sealed_suite
        return not of.on_request if self.is_full else of.in_paper_suite

    @property
    def agents(self) -> list[str]:
        """Agents that the compared methods run on, each once."""
        return list(dict.fromkeys(spec.agent for spec in self.specs if spec.agent is not None))

    def protocol(self, sample_time: float) -> Protocol:
        """Return the protocol at one sample time [s]."""
        recorded = self.recorded_variance
        return Protocol(
            "full" if self.is_sealed else self.suite,
            self.draws,
            sample_time,
            self.initial_error_deg,
            self.seed,
            recorded,
            ZERO_DEVIATION_DEG if self.sensor_zero_deviation_deg is None else self.sensor_zero_deviation_deg,
        )


@dataclasses.dataclass(frozen=True)
class Result:
    """Results of a comparison."""

    scores: "list[Score]"  # of every method
    tracks: "dict[Condition, Record]"  # by noise: the first record with all estimates, at the first T
    records: int  # number of test records
    remark: str = ""  # a further remark on them
