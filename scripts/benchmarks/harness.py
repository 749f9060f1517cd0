"""Harness of benchmarks: measurements by name, results with their peers, commands, two jobs timed in turn."""

import dataclasses
import inspect
import operator
import os
import platform
import re
import resource
import shlex
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray
from tabulate import tabulate

from twin.errors import InputError
from twin.preset import load_preset, load_ranges

Array = NDArray[np.float64]
OnProgress = Callable[[int, int], None]

SAMPLE_TIME = 0.02  # time between two samples [s]


@dataclasses.dataclass(frozen=True)
class Result:
    """Measured figure of a benchmark."""

    name: str  # name of the figure
    value: float  # measured value, in `unit`
    unit: str  # unit of both values
    # required bound: "< 2 ms" of the value, "< 2 times ..." of its ratio, or words; empty without one
    bar: str = ""
    kept: bool | None = None  # True if a bound in words holds
    peer: str | None = None  # reference measured in the same run; None without one
    peer_value: float | None = None  # measured value of the reference, in `unit`

    @property
    def holds(self) -> bool:
        """Whether the value is within the bar."""
        bound = re.match(r"([<>]=?) ([\d.e-]+)( times)?", self.bar)
        if self.kept is not None or bound is None:
            return self.kept is not False
        figure = self.ratio if bound[3] else self.value
        return figure is not None and bool(_SIGNS[bound[1]](figure, float(bound[2])))

    @property
    def ratio(self) -> float | None:
        """Value divided by that of the peer; None without one."""
        return None if not self.peer_value else self.value / self.peer_value

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as `benchmark.json` holds it."""
        names = ("value", "unit", "peer", "peer_value", "ratio", "bar", "holds")
        machine = f"{platform.machine()}, {os.cpu_count()} cores"
        return {name: getattr(self, name) for name in names} | {"machine": machine}


_SIGNS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
Measurement = Callable[..., Result | dict[str, Result]]
F = TypeVar("F", bound=Measurement)
MEASUREMENTS: dict[str, Measurement] = {}  # each measurement by its name: a result, or several


def measurement(name: str) -> Callable[[F], F]:
    """Register a function, whose parameters are options of `measure`."""

    def register(function: F) -> F:
        MEASUREMENTS[name] = function
        return function

    return register


def measure(
    names: tuple[str, ...], progress: Callable[[str], OnProgress], **options: Any
) -> dict[str, Result]:
    """Run measurements one after the other and return their results by name.

    A function gets the options that it has parameters for: `preset`, its `ranges`, `amplitude` [m],
    `progress` and the sizes.
    """
    if unknown := [name for name in names if name not in MEASUREMENTS]:
        raise InputError(f"unknown measurement {unknown[0]!r}; valid: {', '.join(MEASUREMENTS)}")
    wanted = {name: inspect.signature(MEASUREMENTS[name]).parameters for name in names}
    known = options | {"preset": load_preset(options["preset"])}
    if any("ranges" in parameters for parameters in wanted.values()):
        known["ranges"] = load_ranges(options["preset"])
    results: dict[str, Result] = {}
    for name, parameters in wanted.items():
        known["progress"] = progress(name)
        result = MEASUREMENTS[name](**{key: known[key] for key in parameters})
        results |= result if isinstance(result, dict) else {name: result}
    return results


def results_table(preset: str, results: Mapping[str, Result]) -> str:
    """Return the results as a Markdown table."""
    rows = []
    for result in results.values():
        ratio = "" if result.ratio is None else f"{result.ratio:.3g} times {result.peer}"
        holds = "yes" if result.holds else "no"
        rows.append([result.name, f"{result.value:.3g} {result.unit}", ratio, result.bar, holds])
    headers = ["measurement", "figure", "ratio in the same run", "bar", "holds"]
    table = tabulate(rows, headers=headers, tablefmt="github")
    return f"Preset `{preset}`, by `endotwin benchmark`.\n\n{table}\n"


def sinusoid(amplitude: float, period: float, cycles: float) -> Array:
    """Return a sinusoid from the middle of the stroke, (N,) [m], sampled at `SAMPLE_TIME`."""
    time = np.arange(round(cycles * period / SAMPLE_TIME) + 1) * SAMPLE_TIME
    wave: Array = amplitude * np.sin(2 * np.pi * time / period)
    return wave


def in_turn(
    first: Callable[[], object],
    second: Callable[[], object],
    repeats: int = 5,
    warm_up: bool = True,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[float, float]:
    """Return the median times [s] of two jobs that take turns, so that noise disturbs both alike."""
    times: tuple[list[float], list[float]] = ([], [])
    for repeat in range(repeats + warm_up):
        for job, taken in zip((first, second), times, strict=True):
            start = clock()
            job()
            if repeat >= warm_up:
                taken.append(clock() - start)
    return statistics.median(times[0]), statistics.median(times[1])


def processor_time() -> float:
    """Return the processor time of this process and of those that it waited for [s]."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def processor_seconds(*words: str, stdin: BinaryIO | None = None) -> float:
    """Return the processor time of `python words`, user and system, with its child processes [s]."""
    command, nothing = [sys.executable, "-P", *words], subprocess.DEVNULL
    process = subprocess.Popen(command, stdin=stdin, stdout=nothing, stderr=nothing)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"`python {shlex.join(words)}` ended with exit status {process.returncode}")
    return used.ru_utime + used.ru_stime
