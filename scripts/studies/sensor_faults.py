"""`python -m scripts.studies.sensor_faults POLICY`: a trained estimator, on sensors that turn wrong.

It runs as it is deployed, on endoscopes from the ranges of a preset. After 40 good seconds the sensor is
wrong for 20, then right again.
"""

import dataclasses
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from scripts.command import Options, Summary, run_verb
from scripts.progress import Progress
from twin.files.bounds import check_between
from twin.gate.stream import FAULTS, Fault, Plant, Sample
from twin.live import AssuredEstimator, prepare_runtime
from twin.live.reading import WRONG_SENSOR, Reading
from twin.preset import load_preset, load_ranges
from twin.preset.sensor import SensorModel
from twin.reduced import simulate_batch
from twin.report.tables import aligned_table
from twin.signals.excitation import SIGNALS, command

Array = NDArray[np.float64]
GOOD_S, WRONG_S, AFTER_S = 40.0, 20.0, 25.0
MOTION_MM, WITHIN_S = 2.0, 3.0  # an alarm is in time so long after so much motion
MATTERS_DEG = 6.0  # error of measurements from which a fault matters
BACK_S = 5.0  # after the fault, until errors count again
NONE = Fault("none", WRONG_S, lambda good, _: iter(good))
FROZEN_DEVIATION_DEG, CREEP_DEG = 0.3, 1e-9  # noise of a sensor that is frozen, and its step per sample


def _frozen(at_deg: float | None, deviation_deg: float, step_deg: float) -> Plant:
    """Return a fault that stays at an angle [deg], that of the last sample if not given."""

    def plant(good: Sequence[Sample], before: Sequence[Sample]) -> Iterator[Sample]:
        rng, place = np.random.default_rng(len(good)), before[-1][2] if at_deg is None else at_deg
        for number, (at, pull, _) in enumerate(good):
            yield at, pull, place + deviation_deg * rng.standard_normal() + step_deg * number

    return plant


MORE = (
    Fault("frozen, creeping", WRONG_S, _frozen(None, 0.0, CREEP_DEG)),
    Fault("frozen, with noise", WRONG_S, _frozen(None, FROZEN_DEVIATION_DEG, 0.0)),
    Fault("held near zero", WRONG_S, _frozen(0.0, FROZEN_DEVIATION_DEG, 0.0)),
)
"""Faults of a sensor beyond those that the gate plants."""


@dataclasses.dataclass(frozen=True)
class SensorFaults(Options):
    """Count alarms and errors while a sensor is wrong."""

    policy: tyro.conf.Positional[Path]
    """Trained file of any method."""
    preset: str = "ureteroscope"
    """Endoscope: name of a preset, or a YAML file with ranges; its twins check the sensor."""
    stroke: tuple[float, float] = (2.1, 3.9)
    """Lowest and highest pull [mm]."""
    endoscopes: int = 20
    """How many are drawn."""
    sample_time: float = 0.1
    """T [s]."""
    noise_variance: float = 0.1
    """R [deg^2]."""
    seed: int = 0
    """Of endoscopes, commands, noise and zeros."""


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One fault on one endoscope."""

    false: int  # samples with an alarm of the sensor before the fault
    matters: bool  # whether measurements were ever wrong by `MATTERS_DEG`
    in_time: bool  # whether an alarm came in time
    square: float  # mean square error while the sensor was wrong [deg^2]
    largest_deg: float  # error meanwhile
    inside: float  # share of these samples whose interval holds the truth
    square_after: float  # mean square error once it was right again [deg^2]


def sensor_faults(args: SensorFaults) -> Summary:
    """Run every fault on every endoscope, and make a table."""
    check_between("endoscopes", args.endoscopes, 1, 10_000)
    T, R = args.sample_time, args.noise_variance
    preset, ranges = load_preset(args.preset), load_ranges(args.preset)
    known = SensorModel(variance_deg2=R)
    begun = prepare_runtime(
        args.policy, sample_time=T, noise_variance=R, sensor=known, twins=(preset, ranges)
    )
    faults = [NONE, *(fault for fault in FAULTS if fault.of_sensor), *MORE]
    found: dict[str, list[Outcome]] = {fault.name: [] for fault in faults}
    progress, kinds = Progress("faults", "run"), list(SIGNALS)
    for number in range(args.endoscopes):
        rng = np.random.default_rng([args.seed, number])
        low, high = (of * 1e-3 for of in args.stroke)
        pull = command(kinds[number % len(kinds)], (low, high), GOOD_S + WRONG_S + AFTER_S, T, rng)
        (episode,) = simulate_batch([ranges.draw(preset, rng)], [pull], T)
        if episode is None:
            continue
        truth = episode.truth_deg
        zero = known.zero_deviation_deg * rng.standard_normal()
        measured = truth + zero + np.sqrt(R) * rng.standard_normal(len(truth))
        for place, fault in enumerate(faults):
            outcome = run_fault(begun(float(measured[0])), fault, pull * 1e3, truth, measured, T)
            found[fault.name].append(outcome)
            progress(number * len(faults) + place + 1, args.endoscopes * len(faults))
    headers = ["fault", "in time", "where it matters", "RMSE", "largest", "inside", "RMSE after", "false"]
    table = aligned_table([row(name, of) for name, of in found.items()], headers)
    values = {name: [dataclasses.asdict(one) for one in of] for name, of in found.items()}
    return Summary(f"{len(found[NONE.name])} endoscopes, {args.policy}", values, table=table)


def run_fault(
    live: AssuredEstimator, fault: Fault, pull_mm: Array, truth: Array, measured: Array, T: float
) -> Outcome:
    """Run one stream (N,) whose sensor is wrong for a while."""
    good = [(k * T, float(pull_mm[k]), float(measured[k])) for k in range(len(truth))]
    begin, end = round(GOOD_S / T), round((GOOD_S + WRONG_S) / T)
    planted = [*fault.plant(good[begin:end], good[:begin])]
    readings: list[Reading] = [live.push(*sample) for sample in [*good[:begin], *planted, *good[end:]]]
    error = np.array([of.bend_deg for of in readings]) - truth
    inside = np.array([of.low_deg <= bend <= of.high_deg for of, bend in zip(readings, truth, strict=True)])
    alarm = np.array([bool(of.alarms & WRONG_SENSOR) for of in readings])
    way = np.abs(np.diff(pull_mm[begin:end])).cumsum()
    moved = int(np.argmax(way >= MOTION_MM)) if way[-1] >= MOTION_MM else end - begin
    due = min(begin + moved + round(WITHIN_S / T), end)
    wrong = np.array([sample[2] for sample in planted]) - measured[begin:end]
    back = error[end + round(BACK_S / T) :]
    return Outcome(
        int(alarm[:begin].sum()),
        bool(np.abs(wrong[: due - begin]).max() > MATTERS_DEG),
        bool(alarm[begin : due + 1].any()),
        float(np.mean(error[begin:end] ** 2)),
        float(np.abs(error[begin:end]).max()),
        float(inside[begin:end].mean()),
        float(np.mean(back**2)),
    )


def row(name: str, outcomes: list[Outcome]) -> list[str]:
    """Return the line of a table for one fault."""
    matter = [of.in_time for of in outcomes if of.matters]
    return [
        name,
        f"{np.mean([of.in_time for of in outcomes]):.0%}",
        f"{np.mean(matter):.0%} of {len(matter)}" if matter else "-",
        f"{np.sqrt(np.mean([of.square for of in outcomes])):.2f}",
        f"{max(of.largest_deg for of in outcomes):.1f}",
        f"{np.mean([of.inside for of in outcomes]):.0%}",
        f"{np.sqrt(np.mean([of.square_after for of in outcomes])):.2f}",
        str(sum(of.false for of in outcomes)),
    ]


main = partial(run_verb, SensorFaults, sensor_faults)

if __name__ == "__main__":
    sys.exit(main())
