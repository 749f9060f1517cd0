"""Cases of a comparison: the measurements of a group of records under drawn noise."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Case
from twin.evaluation.protocol import RECORDED, Condition, Protocol
from twin.evaluation.record import EvaluationRecord
from twin.signals.noise import KINDS, draw_errors, noise_bound, noise_variance

Array = NDArray[np.float64]
Chosen = NDArray[np.bool_]


def make_case(
    records: Sequence[tuple[int, EvaluationRecord]], protocol: Protocol, conditions: Sequence[Condition] = ()
) -> Case:
    """Return all runs of a group: records, then noises, then seeds; shorter records are padded.

    Args:
        records: each with its number in the test set, which its noise is drawn by.
        protocol: noises, seeds and initial error.
        conditions: noises, if not all of the protocol's suite.
    """
    conditions = conditions or protocol.conditions
    samples = max(len(record.pull_mm) for _, record in records)
    pulls, measurements, truths = [], [], []
    for number, record in records:
        rest = samples - len(record.pull_mm)
        measured = np.concatenate(
            [_measurements(condition, number, record, protocol) for condition in conditions]
        )
        measurements.append(np.pad(measured, ((0, 0), (0, rest)), constant_values=np.nan))
        pulls.append(np.broadcast_to(np.pad(record.pull_mm, (0, rest), mode="edge"), measurements[-1].shape))
        truths.append(
            np.broadcast_to(np.pad(record.bend_deg, (0, rest), mode="edge"), measurements[-1].shape)
        )
    truth = np.concatenate(truths)

    def of_each_run(value: Callable[[str, float], float]) -> Array:
        values = np.repeat([value(kind, level) for kind, level in conditions], protocol.seeds)
        return np.tile(values, len(records))

    return Case(
        pull_mm=np.concatenate(pulls),
        measurement_deg=np.concatenate(measurements),
        initial_bend_deg=truth[:, 0] + protocol.initial_error_deg,
        sensor=Sensor(of_each_run(_variance), of_each_run(_bound)),
        noises=tuple(condition for condition in conditions for _ in range(protocol.seeds)) * len(records),
        truth_deg=truth,
    )


def first_draws(case: Case, seeds: int) -> Chosen:
    """Return which of the B runs of a case are those of the first draw of each noise on each record."""
    chosen: Chosen = np.arange(len(case.pull_mm)) % seeds == 0
    return chosen


def runs_of(case: Case, chosen: Chosen) -> Case:
    """Return some runs of a case, without the truth.

    Args:
        case: B runs.
        chosen: (B,) which.
    """
    runs = np.flatnonzero(chosen)
    sensor = Sensor(*(np.asarray(of)[runs] for of in (case.sensor.variance, case.sensor.bound)))
    return Case(
        case.pull_mm[runs],
        case.measurement_deg[runs],
        np.asarray(case.initial_bend_deg)[runs],
        sensor,
        tuple(case.noises[run] for run in runs),
    )


def group_records(records: Sequence[EvaluationRecord]) -> list[list[tuple[int, EvaluationRecord]]]:
    """Return the records of each stroke and kind of twin, with their numbers in the test set."""
    groups: dict[tuple[Any, str], list[tuple[int, EvaluationRecord]]] = {}
    for number, record in enumerate(records):
        groups.setdefault((record.stroke_mm, record.twin), []).append((number, record))
    return list(groups.values())


def _measurements(condition: Condition, number: int, record: EvaluationRecord, protocol: Protocol) -> Array:
    """(seeds, N) measured angle [deg]: the truth and drawn noise, or what the sensor of the record saw."""
    kind, level = condition
    if kind == RECORDED:
        if record.measured_deg is None:
            raise InputError(f"{record.name}: the record holds no measurement")
        return record.measured_deg[None]
    noise = _draws(kind, level, number, record.bend_deg, protocol)
    return np.where(record.seen, record.bend_deg + noise, np.nan)


def _draws(noise: str, level: float, record: int, bend_deg: Array, protocol: Protocol) -> Array:
    """(seeds, N) noise [deg]; each seed has its own stream, whatever their number."""
    kind = KINDS.index(noise)
    streams = [
        np.random.default_rng([protocol.seed, seed, record, kind, round(level * 1000)])
        for seed in range(protocol.seeds)
    ]
    T = protocol.sample_time_s
    return np.stack([draw_errors(noise, level, bend_deg, T, rng) for rng in streams])


def _variance(kind: str, level: float) -> float:
    return level if kind == RECORDED else noise_variance(kind, level)


def _bound(kind: str, level: float) -> float:
    return np.inf if kind == RECORDED else noise_bound(kind, level)
