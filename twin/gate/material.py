"""Material of the gate: the policy, the preset, the user's logs, and what several checks share."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.dataset.farthest import check_reached, farthest_pull
from twin.episode import Episode
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator
from twin.estimation.knowledge import Case
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.load import load_estimator_at
from twin.evaluation.case import first_draws, runs_of
from twin.evaluation.reading import at_sample_time, evaluation_record
from twin.evaluation.record import EvaluationRecord
from twin.files.bounds import SAMPLE_TIMES, check_between
from twin.files.shown import shown
from twin.gate.cases import NOISES, Runs, draw_commands, noisy, simulate_runs, stream
from twin.gate.rival import tuned_rival
from twin.gate.trial import PairedTrial, run_trials
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.preset.sample_time import check_sample_time
from twin.reduced.member_set import check_members

Array = NDArray[np.float64]
WIDER = 1.5
"""Times the ranges of the preset: what the second set of twins is drawn from."""
STROKE_MM = (-4.0, 4.0)  # where neither policy nor logs tell another
LEAST_LOG = 20  # samples of a log that anything can be learned from
_RIVAL, _HELD_OUT, _WIDER, _LOGS, _RESAMPLING = range(5)
OTHER_STREAMS = 5  # the first number of a stream that a check may take for itself


@dataclasses.dataclass(frozen=True)
class Effort:
    """Amount of evidence that is gathered.

    Attributes:
        kinds: kinds of signal on each of three strokes.
        twins: along each command.
        draws: of each noise on each twin.
        log_draws: of each noise on each log.
        seconds: length of a run [s].
        log_samples: of a log that are looked at, at most.
        hostile: inputs of each kind that a graph is tried on.
        pushes: samples that the latency is measured on.
    """

    kinds: int = 5
    twins: int = 4
    draws: int = 2
    log_draws: int = 4
    seconds: float = 25.0
    log_samples: int = 1200
    hostile: int = 40_000
    pushes: int = 600


WHOLE, QUICK = Effort(), Effort(3, 2, 1, 2, 15.0, 300, 10_000, 200)


@dataclasses.dataclass(frozen=True)
class GateLog:
    """One log of the user.

    Attributes:
        record: at even samples from its first known angle on.
        is_measured: whether a device left it, and no twin: its angles are what a sensor said.
        sheath_bend: (N,) where the log tells it, else empty [rad].
    """

    record: EvaluationRecord
    is_measured: bool
    sheath_bend: Array

    @classmethod
    def of(cls, episode: Episode, sample_time: float, number: int, most: int) -> "GateLog":
        """Return the log of an episode, at most so many samples of it."""
        even = at_sample_time(episode, sample_time)
        record = evaluation_record(even, number)
        begin = len(even.pull) - len(record.pull_mm)
        if len(record.pull_mm) < LEAST_LOG:
            raise InputError(
                f"{record.name}: {len(record.pull_mm)} samples at T = {sample_time:g} s: the gate needs "
                f"{LEAST_LOG}"
            )
        short = dataclasses.replace(
            record,
            pull_mm=record.pull_mm[:most],
            bend_deg=record.bend_deg[:most],
            seen=record.seen[:most],
            measured_deg=None if record.measured_deg is None else record.measured_deg[:most],
        )
        bend = even.sheath_bend[begin:][:most] if even.sheath_bend.size else np.empty(0)
        return cls(short, episode.is_measured, bend)


@dataclasses.dataclass
class GateMaterial:
    """Policy, preset and logs under test; what several checks need of them is made once.

    Attributes:
        path: of the policy.
        file: the same, read.
        estimator: of it, at the sample time, not told of a sensor yet.
        preset: the endoscope that it is to run on.
        ranges: what varies from one of them to the next.
        logs: of the user; may be none.
        stroke_mm: within which twins are pulled [mm].
        sample_time: T [s].
        seed: of all that is drawn.
        size: how much is drawn.
        tell: told how far the check that runs has come, from 0 to 1.
    """

    path: Path
    file: TrainedFile
    estimator: Estimator[Any]
    preset: Preset
    ranges: Ranges
    logs: tuple[GateLog, ...]
    stroke_mm: tuple[float, float]
    sample_time: float
    seed: int
    size: Effort = WHOLE
    tell: Callable[[float], None] = lambda share: None
    _cases: dict[int, list[Case]] = dataclasses.field(default_factory=dict)
    _made: dict[str, Any] = dataclasses.field(default_factory=dict)

    def part(self, low: float, high: float) -> Callable[[int, int], None]:
        """Return what is told how many of how many steps of a part of a check are done."""
        return lambda done, total: self.tell(low + (high - low) * done / max(total, 1))

    def once(self, name: str, make: Callable[["GateMaterial"], Any]) -> Any:
        """Return what several checks share; it is made when the first of them asks."""
        if name not in self._made:
            self._made[name] = make(self)
        return self._made[name]

    def random(self, purpose: int) -> np.random.Generator:
        """Return random numbers of one purpose, from the gate's own stream."""
        return stream(self.seed, purpose)

    @property
    def resampling(self) -> np.random.Generator:
        """Random numbers of a bootstrap."""
        return self.random(_RESAMPLING)

    @functools.cached_property
    def rival(self) -> ActiveModel:
        """The tuned active model of the preset."""
        rng = self.random(_RIVAL)
        pulls, strokes = draw_commands(self.stroke_mm, self.size.seconds, self.sample_time, 5, rng)
        nominal = simulate_runs(self.preset, None, pulls, strokes, 1, self.sample_time, rng)
        drawn = simulate_runs(self.preset, self.ranges, pulls, strokes, 1, self.sample_time, rng)
        records = list(zip(nominal.pull_mm, nominal.bend_deg[:, 0], strict=True))
        return tuned_rival(records, drawn, rng, self.sample_time)

    @functools.cached_property
    def held_out(self) -> list[PairedTrial]:
        """Trials on twins of the preset that no training has seen."""
        return self._on_twins(self.ranges, _HELD_OUT)

    @functools.cached_property
    def wider(self) -> list[PairedTrial]:
        """Trials on twins from wider ranges."""
        return self._on_twins(self.ranges.wider(WIDER), _WIDER)

    def against(self, other: Estimator[Any]) -> list[PairedTrial]:
        """Return the trials on held-out twins beside another rival, with one draw of each noise."""
        trials, draws = self.held_out, self.size.draws
        cases = [_first_draws(case, draws) for case in self._cases[_HELD_OUT]]
        others = run_trials(other, other, cases, trials[0].units, 0, self.part(0.5, 1.0), once=True)
        return [
            trial._replace(squares=trial.squares[:, :1], rival=beside.squares)
            for trial, beside in zip(trials, others, strict=True)
        ]

    def _on_twins(self, ranges: Ranges, purpose: int) -> list[PairedTrial]:
        rng, size = self.random(purpose), self.size
        rival = self.rival
        self.tell(0.2)
        pulls, strokes = draw_commands(self.stroke_mm, size.seconds, self.sample_time, size.kinds, rng)
        runs = simulate_runs(self.preset, ranges, pulls, strokes, size.twins, self.sample_time, rng)
        units = [stroke for stroke in strokes for _ in range(size.twins)]
        cases = [noisy(runs, noise, size.draws, rng) for noise in NOISES]
        self._cases.setdefault(purpose, cases)
        self.tell(0.25)
        return run_trials(self.estimator, rival, cases, units, runs.left_out, self.part(0.25, 1.0))

    @functools.cached_property
    def on_logs(self) -> list[PairedTrial]:
        """Trials on the logs with drawn noise; empty where there is no log."""
        if not self.logs:
            return []
        rng, longest = self.random(_LOGS), max(len(log.record.pull_mm) for log in self.logs)

        def padded(values: Array) -> Array:
            return np.pad(values, (0, longest - len(values)), mode="edge")

        pull = np.array([padded(log.record.pull_mm) for log in self.logs])
        bend = np.array([padded(log.record.bend_deg) for log in self.logs])[:, None]
        seen = np.array(
            [np.pad(log.record.seen, (0, longest - len(log.record.seen))) for log in self.logs], dtype=bool
        )
        runs = Runs(pull, bend, tuple(log.record.stroke_mm for log in self.logs))
        cases = [noisy(runs, noise, self.size.log_draws, rng) for noise in NOISES]
        scored = np.repeat(seen, self.size.log_draws, axis=0)
        cases = [_hidden(case, scored) for case in cases]
        units = [log.record.name for log in self.logs]
        return run_trials(self.estimator, self.rival, cases, units, 0, self.part(0.1, 1.0))


def _first_draws(case: Case, draws: int) -> Case:
    """Return the first draw of the noise of each unit of a case."""
    assert case.truth_deg is not None
    once = first_draws(case, draws)
    return dataclasses.replace(runs_of(case, once), truth_deg=case.truth_deg[once])


def _hidden(case: Case, seen: NDArray[np.bool_]) -> Case:
    """Return a case without measurements where the truth is not known."""
    return dataclasses.replace(case, measurement_deg=np.where(seen, case.measurement_deg, np.nan))


def gather(
    path: Path,
    preset: Preset,
    ranges: Ranges,
    episodes: Sequence[Episode] = (),
    *,
    stroke_mm: tuple[float, float] | None = None,
    sample_time: float | None = None,
    seed: int = 0,
    size: Effort = WHOLE,
) -> GateMaterial:
    """Return the material of the gate, as far as it can be made without work.

    Args:
        path: of the trained file.
        preset: the endoscope.
        ranges: what varies of it.
        episodes: the user's logs.
        stroke_mm: within which twins are pulled; without it, that of the training, as far as the file tells
            it, else that of the logs [mm].
        sample_time: T [s]; without it, that of the training.
        seed: of all that is drawn.
        size: how much is drawn.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no trained file, it cannot run at this sample time, the preset has a second bending
            plane, gravity or another reach, or a log is too short.
    """
    file = read_trained_file(path)
    if sample_time is not None:
        check_between("sample_time", sample_time, *SAMPLE_TIMES, "s")
    estimator, T = load_estimator_at(path, file.agent, sample_time)
    check_members([preset])
    check_sample_time(preset, T)
    logs = tuple(GateLog.of(episode, T, number, size.log_samples) for number, episode in enumerate(episodes))
    stroke = stroke_mm or _trained_stroke(file.description, preset) or _logged_stroke(logs) or STROKE_MM
    if not stroke[0] < stroke[1]:
        raise InputError(f"stroke_mm = {shown(stroke)}: must rise")
    check_reached(preset, stroke)
    return GateMaterial(path, file, estimator, preset, ranges, logs, stroke, T, seed, size)


def _trained_stroke(description: Mapping[str, Any], preset: Preset) -> tuple[float, float] | None:
    """Return the stroke that a policy was trained on, where its file tells one that this endoscope has [mm].

    An endoscope of another size cannot go where the policy learned: it is tried where it can be.
    """
    told = description.get("training")
    stroke = told.get("stroke_mm") if isinstance(told, Mapping) else None
    if not (
        isinstance(stroke, list) and len(stroke) == 2 and all(isinstance(end, int | float) for end in stroke)
    ):
        return None
    most = farthest_pull(preset) * 1e3
    low, high = (float(np.clip(end, -most, most)) for end in stroke)
    return (low, high) if low < high else None


def _logged_stroke(logs: Sequence[GateLog]) -> tuple[float, float] | None:
    """Return the range of the pull in all logs [mm]."""
    if not logs:
        return None
    low = min(float(log.record.pull_mm.min()) for log in logs)
    high = max(float(log.record.pull_mm.max()) for log in logs)
    return (low, high) if low < high else None
