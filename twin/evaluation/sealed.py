"""The sealed test set: conditions that are drawn after the files under test are known.

The seed is a hash of these files and a number. A changed policy meets other conditions, so nothing can be
tuned on them; an unchanged one meets the same. Each condition has an endoscope, a command, a history, a
course of the sheath and a sensor of its own, from the distributions below, which are wider than those of any
training here. All methods of a run meet the same conditions.
"""

import dataclasses
import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.episode import Record
from twin.errors import DivergedError
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Case
from twin.evaluation.protocol import ALL_CONDITIONS
from twin.evaluation.scenarios import FARTHER, SAMPLE_TIME, Scenario, members, simulate_all, simulate_drives
from twin.files.bounded import sha256_of
from twin.preset import Preset, Ranges, load_preset, load_ranges, preset_names
from twin.preset.preset import ZERO_DEVIATION_DEG
from twin.reduced.members import draw_turns
from twin.signals.excitation import SIGNALS, command, paths_to
from twin.signals.noise import DITHER_DEG2, SENSORS, noise_variance
from twin.signals.sensor_errors import with_memory
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]

CONDITIONS = 200
FARTHEST_MM = 4.5  # pull of `ureteroscope` and presets of its size; `LARGER` ones are pulled `FARTHER`
LARGER = ("vio_com",)
HALF_STROKE_MM = (0.5, 4.5)  # drawn log-uniformly; the stroke is anywhere within `FARTHEST_MM`
SLOWER = (0.5, 2.0)  # factor of the periods of a command, log-uniform
WIDER = (1.0, 2.0)  # factor of the ranges of the endoscope, log-uniform
ANOTHER = 0.05  # share of endoscopes of another preset
UNKNOWN_HISTORY = 0.5  # share of records that do not begin at rest
SHEATH_BENDS_ON, SHEATH_MOVES = 0.3, 0.2  # shares: steadily, and within `MOVES_FOR_S`
MOVES_FOR_S = 0.5  # [s]
TOUCHED, TOUCH_N = 0.1, 0.2  # share of records whose tip is pushed, and the largest force [N]
INITIAL_ERROR_DEG = 20.0  # largest error of the initial estimate, evenly drawn [deg]

VARIANCE_DEG2 = (0.05, 10.0)  # R, log-uniform, stated to the filters [deg^2]
CALIBRATED = (
    0.5  # share of sensors without a zero error; else it has the stated deviation `ZERO_DEVIATION_DEG`
)
CORRELATED, CORRELATION_S = 1 / 3, (0.05, 1.0)  # share of noises with a memory, and its time, log-uniform [s]
CHANGES, CHANGE = 0.2, (0.4, 2.5)  # share of noises whose deviation changes by a factor, log-uniform
FAULTY = 0.3  # share of sensors with one of these kinds of errors, at a level that is drawn log-uniformly
LEVELS = {
    "drifting-bias": (0.5, 4.0),
    "correlated": (0.2, 3.0),
    "quantised": (0.5, 4.0),
    "drop-outs": (0.1, 0.6),
    "delayed": (0.05, 0.4),
    "stuck": (0.05, 0.3),
    "stereo-vision": (1.0, 10.0),
}
OUTLIER, ASIDE = 6.0, 3.0  # times as wide: outliers, and the errors to one side of a mixture

KINDS = (
    *(ALL_CONDITIONS, "noise", "sensor fault", "calibrated sensor", "zero unknown"),
    *("start at rest", "unknown history"),
    *("sheath still", "sheath bends on", "sheath moves suddenly", "tip touched", "another endoscope"),
)
"""Groups of conditions that have rows of their own."""

Draw = Callable[[float, int, np.random.Generator], Array]


def _exponential_power(power: float, count: int, rng: np.random.Generator) -> Array:
    size = rng.gamma(1 / power, 1.0, count) ** (1 / power)
    noise: Array = rng.choice([-1.0, 1.0], count) * size
    return noise


def _outliers(share: float, count: int, rng: np.random.Generator) -> Array:
    return rng.standard_normal(count) * np.where(rng.random(count) < share, OUTLIER, 1.0)


def _to_one_side(share: float, count: int, rng: np.random.Generator) -> Array:
    normal = rng.standard_normal(count)
    noise: Array = np.where(rng.random(count) < share, ASIDE * np.abs(normal), normal)
    return noise


class Family(NamedTuple):
    """Family of noise: a draw of a shape, the range of that, which is log-uniform, and what the draw has."""

    draw: Draw
    shapes: tuple[float, float]
    moments: Callable[[float], tuple[float, float]]  # mean and variance of a shape


def _exponential_power_moments(power: float) -> tuple[float, float]:
    from scipy.special import gamma  # imported when used

    return 0.0, float(gamma(3 / power) / gamma(1 / power))


def _one_sided_moments(share: float) -> tuple[float, float]:
    mean = share * ASIDE * float(np.sqrt(2 / np.pi))
    return mean, 1 - share + share * ASIDE**2 - mean**2


FAMILIES = {
    "gaussian": Family(lambda _, count, rng: rng.standard_normal(count), (1.0, 1.0), lambda _: (0.0, 1.0)),
    # 1: Laplace, 2: Gaussian; even, for large ones
    "exponential power": Family(_exponential_power, (0.7, 8.0), _exponential_power_moments),
    "student-t": Family(
        lambda freedom, count, rng: rng.standard_t(freedom, count),
        (2.5, 30.0),
        lambda freedom: (0.0, freedom / (freedom - 2)),
    ),
    "gamma": Family(
        lambda shape, count, rng: rng.gamma(shape, 1.0, count), (0.5, 20.0), lambda shape: (shape, shape)
    ),
    "poisson-dithered": Family(
        lambda rate, count, rng: rng.poisson(rate, count) + rng.uniform(-0.5, 0.5, count),
        (0.1, 10.0),
        lambda rate: (rate, rate + DITHER_DEG2),
    ),
    "outliers": Family(_outliers, (0.01, 0.2), lambda share: (0.0, 1 - share + share * OUTLIER**2)),
    "one-sided mixture": Family(_to_one_side, (0.05, 0.4), _one_sided_moments),
}


@dataclasses.dataclass(frozen=True)
class SealedSensor:
    """A sensor of one condition; filters know `variance_deg2` and `zero_deviation_deg`.

    Attributes:
        kind: a family of `FAMILIES`, or a kind of errors of `LEVELS`.
        level: the shape of the family, or the level of the errors.
        variance_deg2: R [deg^2].
        zero_deg: mean of the errors [deg].
        zero_deviation_deg: its stated standard deviation; 0: calibrated [deg].
        sign: 1, or -1 where a family is mirrored.
        correlation_s: time in which the correlation of a family falls to 1/e; 0: white [s].
        changes_at: share of the record after which the deviation changes; 1: never.
        change: factor of the deviation from then on.
    """

    kind: str
    level: float
    variance_deg2: float
    zero_deg: float
    zero_deviation_deg: float
    sign: float = 1.0
    correlation_s: float = 0.0
    changes_at: float = 1.0
    change: float = 1.0

    def errors(self, bend_deg: Array, sample_time: float, rng: np.random.Generator) -> Array:
        """Draw the errors along a true angle (N,) [deg], NaN where nothing is measured."""
        if self.kind in LEVELS:
            return SENSORS[self.kind].draw(self.level, bend_deg, sample_time, rng) + self.zero_deg
        count = len(bend_deg)
        family = FAMILIES[self.kind]
        mean, variance = family.moments(self.level)
        noise = self.sign * (family.draw(self.level, count, rng) - mean) / np.sqrt(variance)
        noise = with_memory(noise, self.correlation_s, sample_time)
        noise[round(self.changes_at * count) :] *= self.change
        errors: Array = np.sqrt(self.variance_deg2) * noise + self.zero_deg
        return errors


@dataclasses.dataclass(frozen=True)
class SealedCondition:
    """One condition.

    Attributes:
        drive: endoscope and command from the straight, resting endoscope on.
        begin: number of its samples before the record: the history.
        from_rest: whether the record begins at rest, which methods know.
        sensor: the sensor.
        initial_error_deg: error of the initial estimate [deg].
    """

    drive: Scenario
    begin: int
    from_rest: bool
    sensor: SealedSensor
    initial_error_deg: float

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the groups of `KINDS` that the condition belongs to."""
        return (
            ALL_CONDITIONS,
            "sensor fault" if self.sensor.kind in LEVELS else "noise",
            "zero unknown" if self.sensor.zero_deviation_deg else "calibrated sensor",
            "start at rest" if self.from_rest else "unknown history",
            *self.drive.twin.split(", "),
        )

    @property
    def pull(self) -> Array:
        """(N,) command of the record [m]."""
        return self.drive.pull[self.begin :]

    def facts(self) -> dict[str, Any]:
        """Return the condition as a line of a table holds it."""
        low, high = self.drive.stroke_mm
        return {
            "endoscope": self.drive.preset.name,
            "physics": self.drive.twin,
            "signal": self.drive.signal,
            "stroke_low_mm": low,
            "stroke_high_mm": high,
            "history": "rest" if self.from_rest else "unknown",
            "initial_error_deg": self.initial_error_deg,
            **dataclasses.asdict(self.sensor),
        }


def sealed_seed(files: Sequence[Path], number: int) -> int:
    """Return the seed of a test set: a hash of what the files under test hold, in any order, and a number."""
    hashes = sorted(map(sha256_of, files))
    text = " ".join([*hashes, str(number)])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8])


def test_set_name(seed: int) -> str:
    """Return the name of the test set of a seed."""
    return f"{seed:016x}"


def draw_conditions(
    preset: Preset, ranges: Ranges, seconds: float, seed: int, count: int
) -> list[SealedCondition]:
    """Draw conditions; each has a stream of random numbers of its own."""
    streams = (random_stream(seed, SeedUse.SEALED_CONDITIONS, number) for number in range(count))
    return [_draw_condition(preset, ranges, seconds, rng) for rng in streams]


def _draw_condition(
    preset: Preset, ranges: Ranges, seconds: float, rng: np.random.Generator
) -> SealedCondition:
    others = [name for name in preset_names() if name != preset.name]
    another, other = rng.random() < ANOTHER, str(rng.choice(others))
    wider = log_uniform(WIDER, rng)
    if another:
        preset, ranges = load_preset(other), load_ranges(other)
    farther = FARTHER if preset.name in LARGER else 1.0
    drawn = ranges.wider(wider).draw(preset, rng)
    half = log_uniform(HALF_STROKE_MM, rng)
    middle = rng.uniform(-1, 1) * (FARTHEST_MM - half)
    low, high = farther * (middle - half), farther * (middle + half)
    signal, slower = str(rng.choice(list(SIGNALS))), log_uniform(SLOWER, rng)
    pull = command(signal, (low * 1e-3, high * 1e-3), seconds / slower, SAMPLE_TIME / slower, rng)
    from_rest = rng.random() >= UNKNOWN_HISTORY
    turns = draw_turns((low, high), 1, rng) * 1e-3
    history = np.empty(0) if from_rest else paths_to(turns, pull[:1], SAMPLE_TIME)[0]
    begin, samples = len(history), len(history) + len(pull)
    time = (np.arange(samples) - begin) * SAMPLE_TIME
    bend, course = None, rng.random()
    ends, moves_at = [ranges.draw(preset, rng).sheath_bend for _ in range(2)], rng.uniform(0.2, 0.8)
    physics = ["sheath still"]
    if course < SHEATH_BENDS_ON + SHEATH_MOVES:
        steadily = course < SHEATH_BENDS_ON
        physics = ["sheath bends on" if steadily else "sheath moves suddenly"]
        span = (0.0, seconds) if steadily else (moves_at * seconds, moves_at * seconds + MOVES_FOR_S)
        bend = np.interp(time, span, ends)
    force, (first, last) = rng.uniform(0, TOUCH_N), np.sort(rng.random(2))
    pushed = None
    if rng.random() < TOUCHED:
        physics.append("tip touched")
        pushed = force * ((time >= first * seconds) & (time < last * seconds))
    physics += ["another endoscope"] if another else []
    return SealedCondition(
        Scenario(
            ", ".join(physics),
            drawn,
            signal,
            (low, high),
            np.concatenate([history, pull]),
            bend,
            pushed,
        ),
        begin,
        from_rest,
        _draw_sensor(rng),
        rng.uniform(-INITIAL_ERROR_DEG, INITIAL_ERROR_DEG),
    )


def _draw_sensor(rng: np.random.Generator) -> SealedSensor:
    calibrated, zero = rng.random() < CALIBRATED, ZERO_DEVIATION_DEG * rng.standard_normal()
    of_zero = (0.0, 0.0) if calibrated else (zero, ZERO_DEVIATION_DEG)
    if rng.random() < FAULTY:
        kind = str(rng.choice(list(LEVELS)))
        level = log_uniform(LEVELS[kind], rng)
        return SealedSensor(kind, level, noise_variance(kind, level), *of_zero)
    return draw_noise_sensor(None, rng, *of_zero)


def draw_noise_sensor(
    variance_deg2: float | None,
    rng: np.random.Generator,
    zero_deg: float = 0.0,
    zero_deviation_deg: float = 0.0,
) -> SealedSensor:
    """Draw a sensor with a family of noise, and its R [deg^2] if that is None."""
    kind = str(rng.choice(list(FAMILIES)))
    level = log_uniform(FAMILIES[kind].shapes, rng)
    return SealedSensor(
        kind,
        level,
        log_uniform(VARIANCE_DEG2, rng) if variance_deg2 is None else variance_deg2,
        zero_deg,
        zero_deviation_deg,
        sign=float(rng.choice([-1.0, 1.0])),
        correlation_s=log_uniform(CORRELATION_S, rng) if rng.random() < CORRELATED else 0.0,
        changes_at=rng.uniform(0.2, 0.8) if rng.random() < CHANGES else 1.0,
        change=log_uniform(CHANGE, rng),
    )


def log_uniform(limits: tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a number between limits, evenly on a logarithmic scale."""
    low, high = np.log(limits)
    return float(np.exp(rng.uniform(low, high)))


def simulate_conditions(conditions: Sequence[SealedCondition], sample_time: float) -> list[Record]:
    """Simulate the record of each condition in MuJoCo, at T [s]."""
    every, records = round(sample_time / SAMPLE_TIME), []
    episodes = simulate_all([condition.drive for condition in conditions])
    for number, (condition, episode) in enumerate(zip(conditions, episodes, strict=True)):
        if episode is None:
            raise DivergedError(f"the simulation of condition {number} diverged")
        truth = episode.truth_deg[condition.begin :: every]
        records.append(
            Record(
                time=np.arange(len(truth), dtype=float) * sample_time,
                pull_mm=condition.pull[::every] * 1e3,
                truth_deg=truth,
                name=f"condition {number}",
                source=condition.drive.twin,
                stroke_mm=condition.drive.stroke_mm,
            )
        )
    return records


def simulate_members(
    condition: SealedCondition, preset: Preset, ranges: Ranges, count: int, seed: int, sample_time: float
) -> NDArray[np.float32]:
    """Return the angles (M, N) [deg] of an ensemble along the record of a condition, at T [s].

    The members begin at rest, or each after a history of its own.
    """
    drives = members(preset, ranges, condition.pull, count, seed)
    begin = 0
    if not condition.from_rest:
        turns = draw_turns(condition.drive.stroke_mm, count, random_stream(seed, SeedUse.SEALED_HISTORIES))
        paths = paths_to(turns * 1e-3, np.full(count, condition.pull[0]), SAMPLE_TIME)
        begin = paths.shape[1]
        drives = [_after(path, drive) for path, drive in zip(paths, drives, strict=True)]
    episodes = simulate_drives(drives, physics="reduced")
    every = round(sample_time / SAMPLE_TIME)
    found = [episode.truth_deg[begin::every] for episode in episodes if episode is not None]
    return np.array(found, np.float32)


def _after(path: Array, drive: Scenario) -> Scenario:
    bend = drive.sheath_bend
    if bend is not None:
        bend = np.concatenate([np.full(len(path), bend[0]), bend])
    return dataclasses.replace(drive, pull=np.concatenate([path, drive.pull]), sheath_bend=bend)


def sealed_case(
    conditions: Sequence[tuple[int, SealedCondition]],  # with their numbers, that begin alike
    records: Sequence[Record],  # of these
    draws: int,  # of each sensor's errors
    seed: int,
) -> Case:
    """Return all runs of conditions: conditions, then draws."""
    truths, measured = [], []
    for (number, condition), record in zip(conditions, records, strict=True):
        truth, T = record.truth_deg, record.sample_time
        for draw in range(draws):
            rng = random_stream(seed, SeedUse.SEALED_NOISE, number, draw)
            measured.append(truth + condition.sensor.errors(truth, T, rng))
            truths.append(truth)

    def each(values: Sequence[float]) -> Array:
        return np.repeat(np.array(values, dtype=float), draws)

    truth = np.array(truths)
    sensors = [condition.sensor for _, condition in conditions]
    return Case(
        pull_mm=np.repeat([record.pull_mm for record in records], draws, axis=0),
        measurement_deg=np.array(measured),
        initial_bend_deg=truth[:, 0] + each([condition.initial_error_deg for _, condition in conditions]),
        sensor=Sensor(
            each([sensor.variance_deg2 for sensor in sensors]),
            each([sensor.zero_deviation_deg for sensor in sensors]),
            np.inf,
        ),
        noises=tuple(
            (condition.sensor.kind, float(number)) for number, condition in conditions for _ in range(draws)
        ),
        truth_deg=truth,
        from_rest=conditions[0][1].from_rest,
    )
