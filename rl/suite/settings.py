"""Settings of the full benchmark, checked before any work."""

import dataclasses
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rl.options import LIMITS, TrainingOptions
from twin.errors import InputError
from twin.estimation.registry import MethodSpec, method_specs
from twin.evaluation.protocol import Protocol
from twin.evaluation.score import MOST_TRAININGS
from twin.files.bounds import LONGEST_SECONDS, MOST_WORKERS, check_between
from twin.simulation import check_physics
from twin.suite.scenarios import SAMPLE_TIME

OnProgress = Callable[[int, int], None]
NewProgress = Callable[[str, str], OnProgress]
"""Begins to show the progress of a named stage, counted in some unit."""

SAMPLE_TIMES = (0.1, 0.02)
PAPER_SAMPLE_TIME = 0.1  # at which the number of episodes is meant [s]
EVERY = ("all",)
"""Name that is given where every method is meant."""
MOST_MEMBERS = 10_000
"""Largest number of twins in an ensemble."""
MOST_ENSEMBLES = 100
"""Largest number of ensembles."""


@dataclasses.dataclass(frozen=True)
class FullSuite:
    """Everything that the benchmark is run on.

    Attributes:
        folder: where all of it is kept.
        data: test records; without them, the benchmark's own are simulated.
        train: training records; without them, five on the paper's stroke are simulated.
        methods: names of the methods to compare; all but those on request, if empty; `all` for those too.
        method_files: Python files whose methods are loaded here already, for the workers to load too.
        trained: trained files of each agent that is given, one for each training of it; others are trained.
        preset: nominal twin of records and ensembles, and ranges that they are drawn from.
        sample_times: T, each a multiple of 0.02 [s].
        seeds: draws of the noise.
        initial_error_deg: how far the initial estimate is off [deg].
        episodes: of PPO at T = 0.1 s; at another T as many samples.
        trainings: of each learned method that is not given, with this seed and those that follow; its row is
            the mean over them.
        members: twins in an ensemble.
        ensembles: of other twins, each; a row of one is the mean over them.
        member_physics: what they are: `reduced` twins, or such in `mujoco`, as the records are.
        seconds: length of the records that it simulates.
        workers: processes.
        seed: of everything that is drawn.
        recorded_variance: R of recorded measurements, where they are used instead of drawn noise [deg^2].
        dask: address of a Dask scheduler, whose workers are taken in place of processes; they see the folder
            under the same path.
        suite: `full`, or `untrained`: sensors and twins that no training meets.
        origin: command, versions and hashes of the data, as `evaluation.json` states them.
    """

    folder: Path
    data: tuple[Path, ...] = ()
    train: Path | None = None
    methods: tuple[str, ...] = ()
    method_files: tuple[Path, ...] = ()
    trained: dict[str, tuple[Path, ...]] = dataclasses.field(default_factory=dict)
    preset: str = "ureteroscope"
    sample_times: tuple[float, ...] = SAMPLE_TIMES
    seeds: int = 20
    initial_error_deg: float = 20.0
    episodes: int = TrainingOptions.episodes
    trainings: int = 1
    members: int = 256
    ensembles: int = 1
    member_physics: str = "reduced"
    seconds: float = 60.0
    workers: int = 1
    seed: int = 0
    recorded_variance: float | None = None
    dask: str | None = None
    suite: str = "full"
    origin: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what would fail after hours.

        Raises:
            ValueError: a number is out of range.
        """
        for T in self.sample_times:
            self.protocol(T)
            if T < SAMPLE_TIME or abs(T / SAMPLE_TIME - round(T / SAMPLE_TIME)) > 1e-9:
                raise InputError(f"sample_time = {T:g} s: must be a multiple of {SAMPLE_TIME:g} s")
        if self.members < 8:
            raise InputError(f"members = {self.members}: an ensemble needs at least 8")
        check_between("members", self.members, 8, MOST_MEMBERS)
        check_between("ensembles", self.ensembles, 1, MOST_ENSEMBLES)
        check_physics(self.member_physics)
        check_between("seconds", self.seconds, 5, LONGEST_SECONDS, "s")
        check_between("episodes", self.episodes, *LIMITS["episodes"])
        check_between("trainings", self.trainings, 1, MOST_TRAININGS)
        check_between("workers", self.workers, 1, MOST_WORKERS)
        if self.train and os.path.realpath(self.train) in map(os.path.realpath, self.data):
            raise InputError(
                f"training set {self.train} is test data too: what is trained there proves nothing"
            )
        names = [spec.name for spec in method_specs()]
        for name in self.methods:
            if name not in names and self.methods != EVERY:
                raise InputError(f"unknown method {name!r}; valid: {', '.join(names)}")

    @property
    def specs(self) -> list[MethodSpec]:
        """Methods that are compared, in the order of tables.

        Nobody knows the density of a recorded noise, or of a sensor that has a fault.
        """
        if self.methods == EVERY:
            specs = list(method_specs())
        elif self.methods:
            specs = [spec for spec in method_specs() if spec.name in self.methods]
        else:
            specs = [
                spec
                for spec in method_specs()
                if not spec.presentation.on_request or spec.agent in self.trained
            ]
        no_density = self.recorded_variance is not None or self.suite != "full"
        return [spec for spec in specs if not (no_density and spec.needs_density)]

    def protocol(self, sample_time: float) -> Protocol:
        """Return how methods are compared at one sample time."""
        recorded = self.recorded_variance
        return Protocol(self.suite, self.seeds, sample_time, self.initial_error_deg, self.seed, recorded)

    def folder_at(self, sample_time: float) -> Path:
        """Return where all that is made for one sample time is kept."""
        return self.folder / f"T_{sample_time:g}"
