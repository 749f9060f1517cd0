"""The limit of the benchmark: along each command an ensemble of twins, weighed by the measurements."""

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.case import Case
from twin.estimation.ensemble import EnsembleFilter
from twin.estimation.particles import ParticleFilter
from twin.estimation.registry import MethodSpec, register_method
from twin.files.arrays import read_arrays
from twin.files.bounded import MEBIBYTE

Array = NDArray[np.float64]
MOST_BYTES = 1024 * MEBIBYTE
"""Size of a file of an ensemble [bytes]: thousands of members along minutes."""
BIAS_DEVIATIONS = 1.0
"""Standard deviation of the mean of a noise that may be skewed, in units of sqrt(R)."""
_SAME = 1e-9  # two pulls that differ by less are one [mm]
_LEAST = 10  # samples for which a record must follow a command


@dataclasses.dataclass(frozen=True)
class Ensembles:
    """Ensembles along the commands of a test, as one function of a case.

    Attributes:
        paths: files of ensembles, one for each command.
        sample_time: T of the cases, a multiple of that of the files [s].
        knows_density: whether it is told the density of the noise, or its variance alone.
        bias_deviations: standard deviation of the mean of the noise, where it is estimated too [sqrt(R)].
        particles: whether its belief is a mixture, a law for each member.
    """

    paths: tuple[Path, ...]
    sample_time: float
    knows_density: bool = True
    bias_deviations: float = 0.0
    particles: bool = False

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg], as `with_interval` does."""
        return self.with_interval(case)[0]

    def with_interval(self, case: Case) -> tuple[Array, Array]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg].

        Raises:
            ValueError: a run follows a command that there is no ensemble of.
        """
        from twin.signals.noise_density import noise_density  # SciPy: imported when used

        found = np.empty((2, *case.measurement_deg.shape))
        for runs, members_deg in self._alike(case):
            kind, level = case.noises[runs[0]]
            density = noise_density(kind, level) if self.knows_density else None
            variance = float(np.atleast_1d(case.sensor.variance)[runs[0]])
            linear = EnsembleFilter(members_deg, variance, density, self.bias_deviations)
            filters = ParticleFilter(linear) if self.particles else linear
            samples = members_deg.shape[1]
            estimate, half_width = filters.estimate_with_interval(
                case.pull_mm[runs, :samples],
                case.measurement_deg[runs, :samples],
                case.initial_bend_deg[runs],
            )
            assert half_width is not None  # an ensemble states it
            found[:, runs, :samples] = estimate, half_width
            found[:, runs, samples:] = found[:, runs, samples - 1 : samples]
        return found[0], found[1]

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
            raise InputError("a record follows a command that no ensemble was simulated along")
        return best

    @functools.cached_property
    def _loaded(self) -> list[tuple[Array, Array]]:
        """Pull (N,) [mm] and members (M, N) [deg] of every command, read once."""
        loaded = []
        for path in self.paths:
            arrays = read_arrays(path, MOST_BYTES, "ensemble")
            try:
                step = float(arrays["sample_time"])
                pull_mm, bend_deg = arrays["pull_mm"], arrays["bend_deg"]
            except (KeyError, TypeError) as error:
                raise InputError(f"{path} holds no ensemble: remove it, and it is made again") from error
            fits = pull_mm.ndim == 1 and bend_deg.ndim == 2 and bend_deg.shape[1] == len(pull_mm)
            if not fits or bend_deg.dtype.kind != "f" or not 0 < step <= self.sample_time:
                raise InputError(f"{path} holds no ensemble: remove it, and it is made again")
            every = round(self.sample_time / step)
            loaded.append((pull_mm[::every], bend_deg[:, ::every]))
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


def _register(
    name: str,
    rank: float,
    *,
    density: bool,
    bias: float = 0.0,
    particles: bool = False,
    on_request: bool = False,
    is_limit: bool = False,
) -> None:
    """Add a row of the method table; it is told R, or the density of the noise."""
    register_method(
        MethodSpec(
            name=name,
            rank=rank,
            family="ensemble",
            told="the density of the noise" if density else "R",
            build=lambda known: Ensembles(known.ensemble_files, known.sample_time, density, bias, particles),
            ensembles=True,
            needs_density=density,
            on_request=on_request,
            is_limit=is_limit,
        )
    )


_register("Ensemble", 60, density=False)
_register("Ensemble with bias", 60.5, density=False, bias=BIAS_DEVIATIONS, on_request=True)
_register("Ensemble (limit)", 61, density=True, is_limit=True)
_register("Particles (limit)", 62, density=True, particles=True, on_request=True)
