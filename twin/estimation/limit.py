"""The limit of the benchmark: along each command an ensemble of twins, weighed by the measurements."""

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.case import Case
from twin.estimation.ensemble import EnsembleFilter
from twin.estimation.estimator import Estimator
from twin.estimation.families import FamilyFilter
from twin.estimation.particles import ParticleFilter
from twin.estimation.registry import MethodSpec, register_method
from twin.files.arrays import read_arrays
from twin.files.bounded import MEBIBYTE

Array = NDArray[np.float64]
Noise = tuple[str, float]
"""Kind and level of a noise."""
Build = Callable[[Array, float, Noise], Estimator[Any]]
"""Filter of members (M, N) [deg] under a noise of variance R [deg^2]."""
MOST_BYTES = 1024 * MEBIBYTE
"""Size of a file of an ensemble [bytes]: thousands of members along minutes."""
BIAS_DEVIATIONS = 1.0
"""Standard deviation of the mean of a noise that may be skewed, in units of sqrt(R)."""
_SAME = 1e-9  # two pulls that differ by less are one [mm]
_LEAST = 10  # samples for which a record must follow a command


def _told_variance(members_deg: Array, variance: float, noise: Noise) -> EnsembleFilter:
    return EnsembleFilter(members_deg, variance)


def _with_bias(members_deg: Array, variance: float, noise: Noise) -> EnsembleFilter:
    return EnsembleFilter(members_deg, variance, bias_deviations=BIAS_DEVIATIONS)


def _told_density(members_deg: Array, variance: float, noise: Noise) -> EnsembleFilter:
    from twin.signals.noise_density import noise_density  # SciPy: imported when used

    return EnsembleFilter(members_deg, variance, noise_density(*noise))


def _particles(members_deg: Array, variance: float, noise: Noise) -> ParticleFilter:
    return ParticleFilter(_told_density(members_deg, variance, noise))


def _families(members_deg: Array, variance: float, noise: Noise) -> FamilyFilter:
    from twin.signals.noise_density import family_densities

    linear = [EnsembleFilter(members_deg, variance, density) for density in family_densities(variance)]
    return FamilyFilter(tuple(map(ParticleFilter, linear)))


@dataclasses.dataclass(frozen=True)
class Ensembles:
    """Ensembles along the commands of a test, as one function of a case.

    Attributes:
        paths: files of ensembles, one for each command.
        sample_time: T of the cases, a multiple of that of the files [s].
        build: returns the filter on members, by R and by the noise, of which it may take what it is told; if
            not given, the limit's.
    """

    paths: tuple[Path, ...]
    sample_time: float
    build: Build = _told_density

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg], as `with_interval` does."""
        return self.with_interval(case)[0]

    def with_interval(self, case: Case) -> tuple[Array, Array]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg].

        Raises:
            ValueError: a run follows a command that there is no ensemble of.
        """
        found = np.empty((2, *case.measurement_deg.shape))
        for runs, members_deg in self._alike(case):
            variance = float(np.atleast_1d(case.sensor.variance)[runs[0]])
            filters = self.build(members_deg, variance, case.noises[runs[0]])
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


def _register(name: str, build: Build, noise_information: str = "R", needs_density: bool = False) -> None:
    register_method(
        MethodSpec(
            name=name,
            build=lambda known: Ensembles(known.ensemble_files, known.sample_time, build),
            noise_information=noise_information,
            ensembles=True,
            needs_density=needs_density,
        )
    )


_DENSITY = "the density of the noise"
_register("Ensemble", _told_variance)
_register("Ensemble with bias", _with_bias)
_register("Particles (families)", _families, "R, the families of the noise")
_register("Ensemble (limit)", _told_density, _DENSITY, needs_density=True)
_register("Particles (limit)", _particles, _DENSITY, needs_density=True)
