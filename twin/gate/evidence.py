"""Evidence of the gate: the policy, twins that no training has seen, the user's logs, and trials on both.

Everything is drawn from a stream of random numbers that no training has: its seed begins with a number of the
gate's own.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.dataset.recipe import check_reached, farthest_pull
from twin.episode import Episode, Record, without_holes
from twin.errors import DivergedError, InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.knowledge import Case
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.load import load_estimator_at
from twin.estimation.tuning import AM_TUNED, tune_active_model
from twin.files.bounds import SAMPLE_TIMES, check_between
from twin.files.shown import shown
from twin.gate.trial import PairedTrial, joined_cases, run_trials
from twin.identification.models import identify_coleman_hodgdon
from twin.preset.preset import Preset, at_sample_time
from twin.preset.randomization import Ranges
from twin.preset.sensor import SensorModel
from twin.reduced import simulate_batch
from twin.reduced.members import check_members
from twin.signals.excitation import SIGNALS, command
from twin.signals.noise import draw_noise, noise_bound, noise_mean, noise_variance
from twin.signals.sensor import smoothed, smoothing_deviation

Array = NDArray[np.float64]
Stroke = tuple[float, float]  # lowest and highest pull [mm]

STREAM = 0x656E646F7477696E  # only of the gate: seeds of trainings are small numbers, and differ in length
NOISES: tuple[tuple[str, float], ...] = (
    ("gaussian", 1.0),
    ("laplace", 1.0),
    ("uniform", 1.0),
    ("gamma", 1.0),
    ("poisson-dithered", 1.0),
    ("salt-and-pepper", 0.05),
)
"""Kinds and levels."""
RIVAL = AM_TUNED  # the trusted filter that a policy is compared with
INITIAL_ERROR_DEG = 20.0
MOVING = 3  # one twin in so many has its sheath bent on meanwhile
SPARE = 1  # twins beyond those requested: one drawn from wide ranges may find no equilibrium
TUNING_SECONDS = 15.0  # of each record that Q and P of the rival are found on
POPULATION, GENERATIONS = 40, 60  # of the search for the rival's model
WIDER = 1.5  # factor on the ranges of the preset for the second set of twins
STROKE_MM = (-4.0, 4.0)  # where neither policy nor logs have another
LEAST_LOG = 20  # samples of a log
_RIVAL, _HELD_OUT, _WIDER, _LOGS = range(4)
OTHER_STREAMS = 5  # the first number of a stream that a check may use


@dataclasses.dataclass(frozen=True)
class Effort:
    """Amount of evidence."""

    kinds: int = 5  # kinds of signal on each of three strokes
    twins: int = 4  # along each command
    draws: int = 2  # of each noise on each twin
    log_draws: int = 4  # of each noise on each log
    seconds: float = 25.0  # length of a run [s]
    log_samples: int = 1200  # of a log that are used, at most
    hostile: int = 40_000  # inputs that a graph is tried on
    pushes: int = 600  # samples that the latency is measured on


WHOLE, QUICK = Effort(), Effort(3, 2, 1, 2, 15.0, 300, 10_000, 200)


@dataclasses.dataclass(eq=False)
class GateMaterial:
    """Policy, preset and logs under test; what several checks need is computed once."""

    path: Path  # of the policy
    file: TrainedFile  # the same, read
    estimator: Estimator[Any]  # of it, at the sample time, without a sensor
    preset: Preset  # the endoscope that it is to run on
    ranges: Ranges  # what varies from one of them to the next
    logs: tuple[Record, ...]  # of the user, each from its first known angle on; may be none
    log_deviations_deg: tuple[float, ...]  # of the angle of each log, which is smoothed
    sheath_bends: tuple[Array, ...]  # (N,) of each log, empty where it was not recorded [rad]
    stroke_mm: Stroke  # within which twins are pulled [mm]
    sample_time: float  # T [s]
    seed: int  # of all that is drawn
    size: Effort = WHOLE  # how much is drawn
    sensor: SensorModel = dataclasses.field(
        default_factory=SensorModel
    )  # that angles of logs are corrected for
    on_progress: Callable[[float], None] = lambda share: None  # called with the running check's share, 0 to 1

    def part(self, low: float, high: float) -> Callable[[int, int], None]:
        """Return the callback for the steps of a part of a check."""
        return lambda done, total: self.on_progress(low + (high - low) * done / max(total, 1))

    def random(self, purpose: int) -> np.random.Generator:
        """Return random numbers of one purpose, from the gate's own stream."""
        seeds = np.random.SeedSequence([STREAM, self.seed]).spawn(purpose + 1)
        return np.random.default_rng(seeds[purpose])

    def twins(
        self,
        ranges: Ranges | None,
        rng: np.random.Generator,
        *,
        seconds: float,
        kinds: int = 1,
        count: int = 1,
    ) -> tuple[list[Record], int]:
        """Simulate twins of the preset along drawn commands; see `simulate_twins`."""
        pulls, strokes = draw_commands(self.stroke_mm, seconds, self.sample_time, kinds, rng)
        return simulate_twins(self.preset, ranges, pulls, strokes, count, self.sample_time, rng)

    @functools.cached_property
    def rival(self) -> ActiveModel:
        """The tuned active model of the preset (eqs. 4 to 9), which shares nothing with the policy.

        Its model of hysteresis is identified on simulated records of the preset, its Q and P make the
        measurements of randomised twins most likely under every noise of the gate, and R is known.
        """
        rng, T = self.random(_RIVAL), self.sample_time
        pulls, strokes = draw_commands(self.stroke_mm, self.size.seconds, T, 5, rng)
        nominal, _ = simulate_twins(self.preset, None, pulls, strokes, 1, T, rng)
        drawn, _ = simulate_twins(self.preset, self.ranges, pulls, strokes, 1, T, rng)
        records = [(of.pull_mm[0], of.truth_deg[0]) for of in nominal]
        seed = int(rng.integers(2**31))
        model, _ = identify_coleman_hodgdon(records, seed, population=POPULATION, generations=GENERATIONS)
        short = [of.part(0, max(round(TUNING_SECONDS / T), 20)) for of in drawn]
        case = joined_cases([noisy(short, noise, 1, self.sensor.zero_deviation_deg, rng) for noise in NOISES])
        first = ActiveModel(model, T, (0.1, 0.1), case.sensor.variance)
        return tune_active_model(first, case.pull_mm, case.measurement_deg, case.initial_bend_deg)

    @functools.cached_property
    def held_out(self) -> list[PairedTrial]:
        """Trials on twins of the preset that no training has seen."""
        return self._compared(*self._cases(self.ranges, _HELD_OUT))

    @functools.cached_property
    def wider(self) -> list[PairedTrial]:
        """Trials on twins from wider ranges."""
        return self._compared(*self._cases(self.ranges.wider(WIDER), _WIDER))

    def calibrated(self, rival: Estimator[Any]) -> list[PairedTrial]:
        """Return the trials on held-out twins against a rival, where the zero of the sensor is known."""
        cases, units, left_out = self._cases(self.ranges, _HELD_OUT, 0.0)
        return run_trials(self.estimator, rival, cases, units, left_out, self.part(0.1, 1.0))

    def _cases(
        self, ranges: Ranges, purpose: int, zero_deviation_deg: float | None = None
    ) -> tuple[list[Case], list[Any], int]:
        rng, size = self.random(purpose), self.size
        deviation = self.sensor.zero_deviation_deg if zero_deviation_deg is None else zero_deviation_deg
        records, left_out = self.twins(ranges, rng, seconds=size.seconds, kinds=size.kinds, count=size.twins)
        self.on_progress(0.05)
        units = [record.stroke_mm for record in records for _ in range(size.twins)]
        return (
            [noisy(records, noise, size.draws, deviation, rng) for noise in NOISES],
            units,
            left_out,
        )

    def _compared(self, cases: list[Case], units: list[Any], left_out: int) -> list[PairedTrial]:
        rival = self.rival
        self.on_progress(0.25)
        return run_trials(self.estimator, rival, cases, units, left_out, self.part(0.25, 1.0))

    @functools.cached_property
    def on_logs(self) -> list[PairedTrial]:
        """Trials on the logs with drawn noise; empty where there is no log."""
        if not self.logs:
            return []
        rng, longest = self.random(_LOGS), max(len(log.time) for log in self.logs)

        def padded(values: Array) -> Array:
            return np.pad(values, (0, longest - len(values)), mode="edge")[None]

        records = [
            Record(
                np.arange(float(longest)),
                padded(log.pull_mm),
                padded(without_holes(log.time, log.reference_deg)),
            )
            for log in self.logs
        ]
        known = [np.isfinite(log.reference_deg) for log in self.logs]
        seen = np.array([np.pad(of, (0, longest - len(of))) for of in known])
        scored = np.repeat(seen, self.size.log_draws, axis=0)
        cases = [
            noisy(records, noise, self.size.log_draws, self.sensor.zero_deviation_deg, rng)
            for noise in NOISES
        ]
        cases = [
            dataclasses.replace(case, measurement_deg=np.where(scored, case.measurement_deg, np.nan))
            for case in cases
        ]
        units = [log.name for log in self.logs]
        deviation = np.repeat(self.log_deviations_deg, self.size.log_draws)
        progress = self.part(0.7, 1.0)  # of the first check that needs it, after the replay of the logs
        return run_trials(self.estimator, self.rival, cases, units, 0, progress, deviation)


def draw_commands(
    stroke_mm: Stroke, seconds: float, sample_time: float, kinds: int, rng: np.random.Generator
) -> tuple[list[Array], list[Stroke]]:
    """Return commands [m], `kinds` kinds of signal on each of three strokes, and the stroke of each [mm].

    The strokes are a quarter of the reach in its middle, its upper quarter, and all of it.
    """
    low, high = stroke_mm
    middle, width, names = (low + high) / 2, high - low, list(SIGNALS)
    within = ((middle - width / 8, middle + width / 8), (high - width / 4, high), (low, high))
    pulls, strokes = [], []
    for number, stroke in enumerate(within):
        for place in range(kinds):
            name = names[(number + place) % len(names)]
            pulls.append(command(name, (stroke[0] * 1e-3, stroke[1] * 1e-3), seconds, sample_time, rng))
            strokes.append(stroke)
    return pulls, strokes


def simulate_twins(
    preset: Preset,
    ranges: Ranges | None,
    pulls: Sequence[Array],
    strokes_mm: Sequence[Stroke],
    twins: int,
    sample_time: float,
    rng: np.random.Generator,
) -> tuple[list[Record], int]:
    """Simulate K twins from ranges (the preset itself, if None) along each of the (N,) commands [m].

    Returned are a record for each command, pull (1, N) and truth (K, N), and the number of twins that found
    no equilibrium; too many of them raise `DivergedError`.
    """
    each = twins + (0 if ranges is None else SPARE)
    presets: list[Preset] = []
    bends: list[Array | None] = []
    moves = ranges is not None and any(name == "sheath_bend" for name, _, _ in ranges.limits)
    for number, pull in enumerate(pulls):
        for place in range(each):
            presets.append(preset if ranges is None else ranges.draw(preset, rng))
            begin, course = presets[-1].sheath_bend, None
            if ranges is not None and moves and (number + place) % MOVING == 0:
                course = np.linspace(begin, ranges.draw(preset, rng).sheath_bend, len(pull))
            bends.append(course)
    along = [pull for pull in pulls for _ in range(each)]
    episodes = simulate_batch(presets, along, sample_time, sheath_bends=bends)
    records = []
    for number, (pull, stroke) in enumerate(zip(pulls, strokes_mm, strict=True)):
        mine = episodes[number * each : (number + 1) * each]
        truths = [episode.truth_deg for episode in mine if episode is not None][:twins]
        if len(truths) < twins:
            raise DivergedError(f"twins along command {number + 1} of the gate found no equilibrium")
        time: Array = np.arange(float(len(pull))) * sample_time
        records.append(Record(time, pull[None] * 1e3, np.array(truths), stroke_mm=stroke))
    return records, sum(episode is None for episode in episodes)


def noisy(
    records: Sequence[Record],
    condition: tuple[str, float],
    draws: int,
    zero_deviation_deg: float,
    rng: np.random.Generator,
) -> Case:
    """Return the runs of records of equal length under one noise, ordered by record, twin and draw.

    The sensor is as it is declared: the noise has mean zero, and each run a zero of its own, known to within
    its deviation. The truth is included.
    """
    kind, level = condition
    truth = np.concatenate([np.repeat(record.truth_deg, draws, axis=0) for record in records])
    pull = np.concatenate(
        [np.repeat(record.pull_mm, len(record.truth_deg) * draws, axis=0) for record in records]
    )
    zero = zero_deviation_deg * rng.standard_normal((len(truth), 1))
    measured = truth + draw_noise(kind, level, truth.shape, rng) - noise_mean(kind, level) + zero
    off = rng.uniform(-INITIAL_ERROR_DEG, INITIAL_ERROR_DEG, len(truth))
    return Case(
        pull_mm=pull,
        measurement_deg=measured,
        initial_bend_deg=truth[:, 0] + off,
        sensor=Sensor(
            np.full(len(truth), noise_variance(kind, level)),
            np.full(len(truth), zero_deviation_deg),
            np.full(len(truth), noise_bound(kind, level)),
        ),
        noises=(condition,) * len(truth),
        truth_deg=truth,
    )


def gather(
    path: Path,
    preset: Preset,
    ranges: Ranges,
    episodes: Sequence[Episode] = (),
    *,
    stroke_mm: Stroke | None = None,
    sample_time: float | None = None,
    seed: int = 0,
    size: Effort = WHOLE,
    sensor: SensorModel | None = None,
) -> GateMaterial:
    """Return the material of the gate, before anything is simulated.

    The stroke within which twins are pulled [mm] and T [s] are those of the training, if not given; without a
    stroke in the file, that of the logs. So is the sensor of the logs that of the preset.
    """
    sensor = SensorModel.of(preset) if sensor is None else sensor
    file = read_trained_file(path)
    if sample_time is not None:
        check_between("sample_time", sample_time, *SAMPLE_TIMES, "s")
    estimator, T = load_estimator_at(file, sample_time, sensor)
    check_members([preset])
    at_sample_time(preset, T)
    logs, deviations, sheath_bends = [], [], []
    for number, episode in enumerate(episodes):
        log, deviation, sheath_bend = _log_of(episode, T, number, size.log_samples, sensor)
        logs.append(log)
        deviations.append(deviation)
        sheath_bends.append(sheath_bend)
    stroke = stroke_mm or _trained_stroke(file.description, preset) or _logged_stroke(logs) or STROKE_MM
    if not stroke[0] < stroke[1]:
        raise InputError(f"stroke_mm = {shown(stroke)}: must rise")
    check_reached(preset, stroke)
    return GateMaterial(
        *(path, file, estimator, preset, ranges, tuple(logs), tuple(deviations), tuple(sheath_bends)),
        *(stroke, T, seed, size),
        sensor=sensor,
    )


def _log_of(
    episode: Episode, sample_time: float, number: int, most: int, sensor: SensorModel
) -> tuple[Record, float, Array]:
    """Return a log from its first known angle on, and its sheath bend where it was recorded [rad].

    Measured angles are corrected for the sensor, and smoothed: a twin is not compared with noise. The
    standard deviation of what is left is returned too [deg].
    """
    deviation = 0.0
    if episode.is_measured:
        deviation = smoothing_deviation(episode.time, episode.measured_deg) / sensor.scale
        smooth = smoothed(episode.time, episode.measured_deg)
        angle = np.radians(sensor.angles_deg(episode.time, smooth))
        episode = dataclasses.replace(episode, measured_bend=angle)
    even = episode.resampled(sample_time)
    record = even.record(number)
    known = np.isfinite(record.reference_deg)
    first = int(known.argmax())
    if known[first:].sum() < 2 or len(known) - first < LEAST_LOG:
        raise InputError(
            f"{record.name}: {known.sum()} known angles of {len(known)} samples at T = {sample_time:g} s: "
            f"the gate needs {LEAST_LOG} samples"
        )
    bend = even.sheath_bend[first:][:most] if even.sheath_bend.size else np.empty(0)
    return record.part(first, first + most), deviation, bend


def _trained_stroke(description: Mapping[str, Any], preset: Preset) -> Stroke | None:
    """Return the stroke of the training, where its file has one that this endoscope can go [mm].

    An endoscope of another size cannot go where the policy learned: it is tried where it can be.
    """
    training = description.get("training")
    stroke = training.get("stroke_mm") if isinstance(training, Mapping) else None
    if not (
        isinstance(stroke, list) and len(stroke) == 2 and all(isinstance(end, int | float) for end in stroke)
    ):
        return None
    most = farthest_pull(preset) * 1e3
    low, high = (float(np.clip(end, -most, most)) for end in stroke)
    return (low, high) if low < high else None


def _logged_stroke(logs: Sequence[Record]) -> Stroke | None:
    """Return the range of the pull in all logs [mm]."""
    if not logs:
        return None
    low, high = (min(float(log.pull_mm.min()) for log in logs), max(float(log.pull_mm.max()) for log in logs))
    return (low, high) if low < high else None
