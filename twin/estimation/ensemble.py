"""Ensembles of randomised twins along a command, weighed by the measurements: the limit of the comparison.

`EnsembleFilter` is linear (Evensen 2003; Hunt et al. 2007), `ParticleFilter` a Gaussian sum (Alspach and
Sorenson 1972), `FamilyFilter` a filter bank over families of noise (Bayes). Twins are simulated once, for
every noise and seed. They know the physics and the ranges of its parameters. Among linear estimators that
know no more the first is the best, but for the finite number of members; a nonlinear one can do somewhat
better, as twins are not normal.
"""

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import DEVIATIONS_OF_95, half_width_of
from twin.estimation.knowledge import Case
from twin.estimation.registry import MethodSpec, register_method
from twin.files.arrays import read_arrays
from twin.files.bounded import MEBIBYTE

if TYPE_CHECKING:
    from twin.signals.noise_density import NoiseDensity

Array = NDArray[np.float64]
NARROW = 0.5  # beliefs narrower than this share of the noise's standard deviation are moved by the score
BANDWIDTH, ROUGH_BANDWIDTH = 0.7, 0.95
"""Width of a particle's kernel as a share of the ensemble's, and where the density of the noise is rough.

Chosen on reduced twins that no test has: 0.5 to 0.9 are all better than the linear limit, for rough densities
0.95 by 1 to 3 %."""
MOST_BYTES = 1024 * MEBIBYTE  # size of a file of an ensemble [bytes]: thousands of members along minutes
_SAME = 1e-9  # two pulls that differ by less are one [mm]
_LEAST = 10  # samples for which a record must follow a command


class EnsembleState(NamedTuple):
    """Coefficients of B filters, and the covariance that they share, as all know the same noise."""

    sample: int  # number of the latest sample
    mean: Array  # (M, B) of the coefficients
    covariance: Array  # (M, M) of the coefficients


@dataclasses.dataclass(frozen=True)
class EnsembleFilter(Estimator[EnsembleState]):
    """An ensemble along one command: all B filters follow that command and have one sensor.

    The angle is sought among the affine combinations of the members: angle_k = mean_k + c . anomaly_k. The
    coefficients c do not change with time and are normal before anything is measured, so that mean and
    covariance of the angle over all times are those of the ensemble. Each measurement updates c: an ensemble
    Kalman filter in the space of the weights.

    Where the density of the noise is known, c moves by the score of the innovation, as by Masreliez (1975),
    if its belief is narrow, and by the best linear update of that noise if it is not. Its covariance shrinks
    by the mean slope of the score, not by the slope at the innovation: so all filters of one noise share it.
    """

    members_deg: Array  # (M, N) angle of each member at each sample of the command [deg]
    measurement_variance: float = 0.1  # R [deg^2]
    density: "NoiseDensity | None" = None  # of the noise; if unknown, normal, of mean zero and variance R
    # standard deviation of the sensor's zero, which is then one more coefficient [deg]; the density is taken
    # about its mean. 0: the density is where it is
    zero_deviation_deg: float = 0.0

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R, which all filters of the batch share."""
        variances = np.unique(sensor.variance)
        if variances.size > 1:
            raise InputError(f"an ensemble has one sensor for all its filters, not R = {variances.tolist()}")
        return dataclasses.replace(self, measurement_variance=float(variances[0]))

    def start(self, pull_mm: Array, bend_deg: Array) -> EnsembleState:
        """Return the state at the first sample; the initial estimate is not used."""
        count = len(self.members_deg) + bool(self.zero_deviation_deg)
        return EnsembleState(0, np.zeros((count, bend_deg.size)), np.eye(count))

    def step(
        self, state: EnsembleState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> EnsembleState:
        """Weigh the members by one measurement, which all filters have or none.

        Beyond the end of the command the members stay where they ended.
        """
        sample = min(state.sample + 1, self.members_deg.shape[1] - 1)
        if not sole_measurement(measurement_deg):
            return state._replace(sample=sample)
        mean, anomaly = self.mean_and_anomaly(sample)
        seen = self._with_bias(anomaly, self.zero_deviation_deg)
        cross = state.covariance @ seen  # covariance of the coefficients with the measured angle
        spread = float(np.sqrt(max(float(seen @ cross), 0.0)))
        score, information = self.weigh(measurement_deg - mean - seen @ state.mean, spread)
        return EnsembleState(
            sample,
            state.mean + np.outer(cross, score),
            state.covariance - np.outer(cross, information * cross),
        )

    def bend_deg(self, state: EnsembleState) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        mean, anomaly = self.mean_and_anomaly(state.sample)
        return mean + self._with_bias(anomaly) @ state.mean

    def half_width_deg(self, state: EnsembleState) -> Array:
        """Return half of the (B,) 95 % intervals of the belief [deg], one for all filters."""
        angle = self._with_bias(self.mean_and_anomaly(state.sample)[1])
        return np.full(state.mean.shape[1], half_width_of(angle @ state.covariance @ angle))

    def _with_bias(self, anomaly: Array, of_bias: float = 0.0) -> Array:
        """Return the factors of the coefficients, where the mean of the noise is one of them."""
        return np.append(anomaly, of_bias) if self.zero_deviation_deg else anomaly

    def weigh(self, innovation: Array, spread: float) -> tuple[Array, float]:
        """Return the (B,) scores of innovations, and their information, for a belief of this deviation."""
        density = self.density
        if density is None:
            information = 1 / (spread**2 + self.measurement_variance)
            return innovation * information, information
        if self.zero_deviation_deg:
            innovation = innovation + density.mean
        if spread > NARROW * np.sqrt(density.variance):
            # The belief may have two peaks then, the angle and an outlier; the best linear update is safe.
            information = 1 / (spread**2 + density.variance)
            return (innovation - density.mean) * information, information
        return density.score(innovation, spread), density.information(spread)

    def log_likelihood(self, innovation: Array, spread: float) -> Array:
        """Return the log-density of innovations [of 1 / deg] for a belief of this deviation.

        A rough density of the noise is replaced by a normal one of the same mean and variance.
        """
        density = self.density
        if density is not None and not density.rough:
            return density.log_density(innovation, spread)
        mean, variance = (density.mean, density.variance) if density else (0.0, self.measurement_variance)
        total = spread**2 + variance
        found: Array = -0.5 * ((innovation - mean) ** 2 / total + np.log(2 * np.pi * total))
        return found

    def mean_and_anomaly(self, sample: int) -> tuple[float, Array]:
        """Return the mean of the members at a sample [deg], and (M,) deviations from it, over sqrt(M - 1)."""
        members = self.members_deg[:, sample].astype(float)
        mean = float(members.mean())
        return mean, (members - mean) / np.sqrt(len(members) - 1)


def sole_measurement(measurement_deg: Array) -> bool:
    """Return whether all filters have a measurement; raises `ValueError` where only some have."""
    missing = np.isnan(measurement_deg)
    if missing.any() and not missing.all():
        raise InputError("filters of one ensemble must miss the same measurements")
    return not missing.any()


def posterior_bound(
    members_deg: Array, information: ArrayLike, seen: NDArray[np.bool_] | None = None
) -> Array:
    """Return the posterior Cramer-Rao bound of normal twins (Van Trees 1968; Tichavsky et al. 1998).

    If the angle were normal with the mean and covariance of the ensemble, no estimator would have a smaller
    mean square error over such twins. Real twins are not normal: an estimator may pass it.

    The bound is a standard deviation (N,) [deg], for members (M, N) [deg], Fisher's information of one
    measurement about the angle [1 / deg^2], and where there is a measurement (N,), everywhere if not given;
    the first sample is not measured.
    """
    count, samples = members_deg.shape
    mean = members_deg.mean(axis=0)
    anomalies = ((members_deg - mean) / np.sqrt(count - 1)).T.astype(float)
    covariance = np.eye(count)
    bound = np.empty(samples)
    for k, anomaly in enumerate(anomalies):
        cross = covariance @ anomaly
        variance = float(anomaly @ cross)
        if k > 0 and (seen is None or seen[k]):
            covariance -= np.outer(cross, cross / (variance + 1 / np.asarray(information)))
            variance = variance / (1 + variance * float(np.asarray(information)))
        bound[k] = np.sqrt(max(variance, 0.0))
    return bound


class ParticleState(NamedTuple):
    """Mixtures of B filters."""

    sample: int  # number of the latest sample
    centre: Array  # (M, B) coefficients that the places of the kernels are counted from
    places: Array  # (M, M) of the kernel of each member about the centre, a column each
    covariance: Array  # (M, M) of each kernel
    log_weights: Array  # (M, B) log-likelihood of all measurements under each kernel

    @property
    def log_evidence(self) -> Array:
        """(B,) log-likelihood of all measurements."""
        top = self.log_weights.max(axis=0)
        found: Array = top + np.log(np.mean(np.exp(self.log_weights - top), axis=0))
        return found


@dataclasses.dataclass(frozen=True)
class ParticleFilter(Estimator[ParticleState]):
    """Particles along one command: all B filters follow that command and have one sensor.

    The belief of the coefficients of `EnsembleFilter` is a mixture, one narrow normal kernel about each
    member. Members are drawn towards their mean as far as the kernels are wide, so that mean and covariance
    stay those of the ensemble (West 1993). Every kernel is updated by the same gains, and its weight is
    multiplied by the likelihood of the measurement under it. As gains do not differ, the kernels of all
    filters of one noise keep the same places about their filter's mean. Where an innovation moves the belief
    by the score of a density, the score is taken at the mean of the mixture, and is linear about it. Kernels
    as wide as the ensemble give the linear filter.
    """

    ensemble: EnsembleFilter  # members, and what is known of the noise
    # h, width of a kernel as a share of that of the ensemble, from 0 to 1; None for that which suits the
    # density of the noise
    bandwidth: float | None = None

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, ensemble=self.ensemble.with_sensor(sensor))

    def start(self, pull_mm: Array, bend_deg: Array) -> ParticleState:
        """Return the state at the first sample; the initial estimate is not used."""
        count, batch = len(self.ensemble.members_deg), bend_deg.size
        members = np.sqrt(count - 1) * (np.eye(count) - 1 / count)
        density, width = self.ensemble.density, self.bandwidth
        if width is None:
            width = ROUGH_BANDWIDTH if density is not None and density.rough else BANDWIDTH
        return ParticleState(
            0,
            np.zeros((count, batch)),
            np.sqrt(1 - width**2) * members,
            width**2 * np.eye(count),
            np.zeros((count, batch)),
        )

    def step(
        self, state: ParticleState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> ParticleState:
        """Move and weigh the kernels by one measurement, which all filters have or none."""
        of = self.ensemble
        sample = min(state.sample + 1, of.members_deg.shape[1] - 1)
        if not sole_measurement(measurement_deg):
            return state._replace(sample=sample)
        mean, anomaly = of.mean_and_anomaly(sample)
        cross = state.covariance @ anomaly
        spread = float(np.sqrt(max(float(anomaly @ cross), 0.0)))
        away = anomaly @ state.places  # (M,) angle of each kernel relative to the centre's
        innovation = measurement_deg - mean - anomaly @ state.centre
        middle = away @ normalised(state.log_weights)
        score, information = of.weigh(innovation - middle, spread)
        likelihood = of.log_likelihood(innovation - away[:, None], spread)
        gain = information * cross
        return ParticleState(
            sample,
            state.centre + np.outer(cross, score + information * middle),
            state.places - np.outer(gain, away),
            state.covariance - np.outer(gain, cross),
            state.log_weights + likelihood,
        )

    def bend_deg(self, state: ParticleState) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        mean, anomaly = self.ensemble.mean_and_anomaly(state.sample)
        away = anomaly @ state.places
        return mean + anomaly @ state.centre + away @ normalised(state.log_weights)

    def half_width_deg(self, state: ParticleState) -> Array:
        """Return half of the (B,) 95 % intervals of a normal distribution of the mixture's variance [deg]."""
        _, anomaly = self.ensemble.mean_and_anomaly(state.sample)
        away, weights = anomaly @ state.places, normalised(state.log_weights)
        between = away**2 @ weights - (away @ weights) ** 2
        return half_width_of(anomaly @ state.covariance @ anomaly + np.maximum(between, 0.0))


def normalised(log_weights: Array) -> Array:
    """Return (n, B) weights that add up to one, by their logarithms."""
    weights = np.exp(log_weights - log_weights.max(axis=0))
    normalised: Array = weights / weights.sum(axis=0)
    return normalised


FamilyState = tuple[ParticleState, ...]  # state of the filter of each family


@dataclasses.dataclass(frozen=True)
class FamilyFilter(Estimator[FamilyState]):
    """A filter bank along one command, one particle filter for each family that the noise may have.

    The limit knows the density of the noise, which no device does. Here R and a list of families are known.
    Each family has a filter of the density that it would have with that R, and is weighed by the marginal
    likelihood of all measurements. Estimate and variance are those of the mixture.
    """

    filters: tuple[ParticleFilter, ...]  # of the same members, equally likely at the start

    def start(self, pull_mm: Array, bend_deg: Array) -> FamilyState:
        """Return the state at the first sample; the initial estimate is not used."""
        return tuple(each.start(pull_mm, bend_deg) for each in self.filters)

    def step(
        self, state: FamilyState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> FamilyState:
        """Step the filter of each family."""
        return tuple(
            each.step(of, pull_mm, previous_pull_mm, measurement_deg)
            for each, of in zip(self.filters, state, strict=True)
        )

    def bend_deg(self, state: FamilyState) -> Array:
        """Return the (B,) mean of the angle over families [deg]."""
        return self._moments(state)[0]

    def half_width_deg(self, state: FamilyState) -> Array:
        """Return half of the (B,) 95 % intervals of a normal distribution of the mixture's variance [deg]."""
        mean, bends = self._moments(state)
        widths = np.array([each.half_width_deg(of) for each, of in zip(self.filters, state, strict=True)])
        variances = (widths / DEVIATIONS_OF_95) ** 2 + (bends - mean) ** 2
        return half_width_of(np.sum(self.weights(state) * variances, axis=0))

    def weights(self, state: FamilyState) -> Array:
        """Return the (families, B) probabilities of the families."""
        return normalised(np.array([of.log_evidence for of in state]))

    def _moments(self, state: FamilyState) -> tuple[Array, Array]:
        bends = np.array([each.bend_deg(of) for each, of in zip(self.filters, state, strict=True)])
        return np.sum(self.weights(state) * bends, axis=0), bends


Noise = tuple[str, float]  # kind and level of a noise
Build = Callable[[Array, Sensor, Noise], Estimator[Any]]
"""Filter of members (M, N) [deg] under a noise; the sensor holds what an estimator may know of it."""


def _known_variance(members_deg: Array, sensor: Sensor, noise: Noise) -> EnsembleFilter:
    return EnsembleFilter(members_deg, _values(sensor)[0])


def _unknown_zero(members_deg: Array, sensor: Sensor, noise: Noise) -> EnsembleFilter:
    variance, deviation = _values(sensor)
    return EnsembleFilter(members_deg, variance, zero_deviation_deg=deviation)


def _known_density(members_deg: Array, sensor: Sensor, noise: Noise) -> EnsembleFilter:
    from twin.signals.noise_density import noise_density  # SciPy: imported when used

    return EnsembleFilter(members_deg, _values(sensor)[0], noise_density(*noise))


def _known_shape(members_deg: Array, sensor: Sensor, noise: Noise) -> EnsembleFilter:
    return dataclasses.replace(
        _known_density(members_deg, sensor, noise), zero_deviation_deg=_values(sensor)[1]
    )


def _particles(members_deg: Array, sensor: Sensor, noise: Noise) -> ParticleFilter:
    return ParticleFilter(_known_density(members_deg, sensor, noise))


def _families(members_deg: Array, sensor: Sensor, noise: Noise) -> FamilyFilter:
    from twin.signals.noise_density import family_densities

    variance, _ = _values(sensor)
    linear = [EnsembleFilter(members_deg, variance, density) for density in family_densities(variance)]
    return FamilyFilter(tuple(map(ParticleFilter, linear)))


def _values(sensor: Sensor) -> tuple[float, float]:
    """Return R [deg^2] and the deviation of the zero [deg] that all filters of a group have."""
    return float(np.ravel(sensor.variance)[0]), float(np.ravel(sensor.zero_deviation_deg)[0])


@dataclasses.dataclass(frozen=True)
class Ensembles:
    """Ensembles along the commands of a test, as one function of a case."""

    paths: tuple[Path, ...]  # files of ensembles, one for each command
    sample_time: float  # T of the cases, a multiple of that of the files [s]
    # returns the filter of members, sensor and noise, of which it uses what it may know
    build: Build = _known_density

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg]."""
        return self.with_interval(case)[0]

    def with_interval(self, case: Case) -> tuple[Array, Array]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg].

        Raises `ValueError` where a run follows a command without an ensemble.
        """
        found = np.empty((2, *case.measurement_deg.shape))
        for runs, members_deg in self._alike(case):
            filters = self.build(members_deg, case.sensor.of_runs(np.array(runs)), case.noises[runs[0]])
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
        return [_read(path, self.sample_time) for path in self.paths]

    def _alike(self, case: Case) -> list[tuple[list[int], Array]]:
        """Runs that share command, noise and missing measurements: their filters share one covariance."""
        groups: dict[tuple[Any, ...], list[int]] = {}
        for run, pull in enumerate(case.pull_mm):
            missing = np.isnan(case.measurement_deg[run]).tobytes()
            groups.setdefault((pull.tobytes(), missing, case.noises[run]), []).append(run)
        return [(runs, self.along(case.pull_mm[runs[0]])) for runs in groups.values()]


@functools.lru_cache(maxsize=256)  # workers read the files of many conditions again and again
def _read(path: Path, sample_time: float) -> tuple[Array, Array]:
    """Return pull (N,) [mm] and members (M, N) [deg] of a file at T [s]."""
    arrays = read_arrays(path, MOST_BYTES, "ensemble")
    try:
        step = float(arrays["sample_time"])
        pull_mm, bend_deg = arrays["pull_mm"], arrays["bend_deg"]
        fits = pull_mm.ndim == 1 and bend_deg.ndim == 2 and bend_deg.shape[1] == len(pull_mm)
        fits = fits and bend_deg.dtype.kind == "f" and 0 < step <= sample_time
    except (KeyError, TypeError):
        fits = False
    if not fits:
        raise InputError(f"{path} holds no ensemble: remove it, and it is made again")
    every = round(sample_time / step)
    return pull_mm[::every], bend_deg[:, ::every]


def _register(name: str, build: Build, *of_noise: str, needs_density: bool = False) -> None:
    register_method(
        MethodSpec(
            name=name,
            build=lambda known: Ensembles(known.ensemble_files, known.sample_time, build),
            given=(*of_noise, "ranges", "past"),
            ensembles=True,
            needs_density=needs_density,
        )
    )


_register("Ensemble", _known_variance, "R")
_register("Ensemble with bias", _unknown_zero, "R", "zero")
_register("Particles (families)", _families, "R", "families")
_register("Ensemble (limit)", _known_density, "law", needs_density=True)
_register("Ensemble (limit, zero unknown)", _known_shape, "law", "zero", needs_density=True)
_register("Particles (limit)", _particles, "law", needs_density=True)
