"""The limit of the benchmark: ensembles of randomised twins along its commands, simulated once and kept."""

import dataclasses
import functools
import hashlib
import io
import itertools
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.estimation.ensemble import EnsembleFilter, posterior_bound
from twin.evaluation.case import Case
from twin.evaluation.method import Method
from twin.evaluation.record import EvaluationRecord
from twin.files.atomic import write_whole
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.signals.noise import fisher_information, noise_variance
from twin.signals.noise_density import noise_density
from twin.suite.scenarios import SAMPLE_TIME, members, simulate_drives

Array = NDArray[np.float64]
_SAME = 1e-9  # two pulls that differ by less are one [mm]
_LEAST = 10  # samples for which a record must follow a command


def make_ensembles(
    preset: Preset,
    ranges: Ranges,
    pulls: Sequence[Array],
    folder: Path,
    *,
    count: int,
    seed: int,
    on_progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Simulate an ensemble along each command, or find the one that an earlier run has kept.

    Args:
        preset: what the members have in common.
        ranges: what they are drawn from.
        pulls: commands (N,) at `SAMPLE_TIME` [m].
        folder: where the ensembles are kept, each under a name that tells what made it.
        count: members of each; one that diverges is left out.
        seed: of the draws.
        on_progress: told how many of how many ensembles are there.

    Returns:
        One `.npz` for each command, with `pull_mm` (N,) and `bend_deg` (members, N).
    """
    folder.mkdir(parents=True, exist_ok=True)
    origin = json.dumps([__version__, preset.to_dict(), ranges.to_dict(), count, seed, SAMPLE_TIME]).encode()
    paths = []
    if on_progress:
        on_progress(0, len(pulls))
    for done, pull in enumerate(pulls, start=1):
        name = hashlib.sha256(origin + np.ascontiguousarray(pull).tobytes()).hexdigest()[:16]
        path = folder / f"{name}.npz"
        if not path.is_file():
            episodes = simulate_drives(members(preset, ranges, pull, count, seed))
            bend = np.array([episode.bend_deg for episode in episodes if episode is not None], np.float32)
            buffer = io.BytesIO()
            np.savez(buffer, pull_mm=pull * 1e3, bend_deg=bend)
            write_whole(path, buffer.getvalue())
        paths.append(path)
        if on_progress:
            on_progress(done, len(pulls))
    return paths


@dataclasses.dataclass(frozen=True)
class Ensembles:
    """What is known of each command: the ensemble along it. A method, as it is called with a case."""

    paths: tuple[Path, ...]
    sample_time: float
    """T of the cases [s]; a multiple of `SAMPLE_TIME`."""
    knows_density: bool = True
    """Whether it is told the density of the noise, or its variance alone."""

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg].

        Raises:
            ValueError: a run follows a command that there is no ensemble of.
        """
        estimate = np.empty_like(case.measurement_deg)
        for runs, members_deg in self._alike(case):
            kind, level = case.noises[runs[0]]
            density = noise_density(kind, level) if self.knows_density else None
            filters = EnsembleFilter(members_deg, noise_variance(kind, level), density)
            samples = members_deg.shape[1]
            estimate[runs, :samples] = filters.estimate(
                case.pull_mm[runs, :samples],
                case.measurement_deg[runs, :samples],
                case.initial_bend_deg[runs],
            )
            estimate[runs, samples:] = estimate[runs, samples - 1 : samples]
        return estimate

    def along(self, pull_mm: Array) -> Array:
        """Return the ensemble (M, n) along a command (N,) [deg].

        A record may begin later than the command that was simulated, where its first angles were missing, and
        may be padded at its end: the ensemble whose command it follows for the longest time is cut to both.

        Raises:
            ValueError: the record follows none.
        """
        best = np.empty((0, 0))
        for known, members_deg in self._loaded:
            for late in map(int, np.flatnonzero(np.abs(known - pull_mm[0]) < _SAME)):
                samples = min(len(known) - late, len(pull_mm))
                here = slice(late, late + samples)
                if samples > best.shape[1] and np.abs(known[here] - pull_mm[:samples]).max() < _SAME:
                    best = members_deg[:, here]
        if best.shape[1] < _LEAST:
            raise ValueError("a record follows a command that no ensemble was simulated along")
        return best

    @functools.cached_property
    def _loaded(self) -> list[tuple[Array, Array]]:
        """Pull (N,) [mm] and members (M, N) [deg] of every command, read once."""
        every = round(self.sample_time / SAMPLE_TIME)
        loaded = []
        for path in self.paths:
            with np.load(path) as arrays:
                loaded.append((arrays["pull_mm"][::every], arrays["bend_deg"][:, ::every]))
        return loaded

    def _alike(self, case: Case) -> list[tuple[list[int], Array]]:
        """Runs that share command, noise and missing measurements: their filters share one covariance."""
        groups: dict[tuple[Any, ...], list[int]] = {}
        for run, pull in enumerate(case.pull_mm):
            missing = np.isnan(case.measurement_deg[run]).tobytes()
            groups.setdefault((pull.tobytes(), missing, case.noises[run]), []).append(run)
        ensembles: dict[bytes, Array] = {}
        for (pull_bytes, _, _), runs in groups.items():
            if pull_bytes not in ensembles:
                ensembles[pull_bytes] = self.along(case.pull_mm[runs[0]])
        return [(runs, ensembles[key[0]]) for key, runs in groups.items()]


def limit_methods(paths: Sequence[Path], sample_time: float) -> list[Method]:
    """Return the ensemble told R, as every filter is, and the limit, which knows the noise's density too."""
    return [
        Method("Ensemble", Ensembles(tuple(paths), sample_time, knows_density=False)),
        Method("Ensemble (limit)", Ensembles(tuple(paths), sample_time)),
    ]


def bounds(
    records: Sequence[EvaluationRecord],
    paths: Sequence[Path],
    sample_time: float,
    conditions: Sequence[tuple[str, float]],
) -> list[dict[str, Any]]:
    """Return the posterior Cramer-Rao bound of each noise that has one, for each stroke.

    `rmse_deg` is its root mean square over a stroke's commands. It is a mean over twins as the ensemble has
    them; a single twin may be better or worse known.
    """
    ensembles = Ensembles(tuple(paths), sample_time)
    strokes: dict[tuple[float, float], dict[bytes, EvaluationRecord]] = {}
    for record in records:
        strokes.setdefault(record.stroke_mm, {}).setdefault(record.pull_mm.tobytes(), record)
    rows = []
    for (stroke, commands), (kind, level) in itertools.product(strokes.items(), conditions):
        information = fisher_information(kind, level)
        if information is None:
            continue
        squares = [
            posterior_bound(ensembles.along(record.pull_mm), information, record.seen)[1:] ** 2
            for record in commands.values()
        ]
        rows.append(
            {
                "noise": kind,
                "level": level,
                "sample_time_s": sample_time,
                "stroke_mm": list(stroke),
                "rmse_deg": float(np.sqrt(np.concatenate(squares).mean())),
            }
        )
    return rows
