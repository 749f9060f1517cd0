"""A bootstrap particle filter (Gordon et al. 1993) on a Coleman-Hodgdon model whose parameters drift.

Each particle has an angle theta [deg], an error f of its model [deg / s] and parameters a, b, c of its own:

    theta_k = F(theta_{k-1}, l_k, l_{k-1}; a, b, c) + f_{k-1} T + v,    f_k = f_{k-1} + w,

with normal v and w. The parameters are multiples of the identified ones, which move by a random walk along
the travel of the tendon. If they stay, this is AM's model, which the Kalman filter solves.

Particles are weighted by the normal density of each measurement under R. Where their effective number falls
below half, they are drawn again, systematically (Kitagawa 1996). The parameters are then moved towards their
mean and spread by a kernel, which keeps mean and variance: no two particles stay alike (Liu and West 2001).
"""

import dataclasses
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.gaussian import half_width_of
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.tuning import TrainingEpisodes, draw_training_episodes, draw_twin_episodes, nelder_mead
from twin.hysteresis import ColemanHodgdon
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
PARTICLES, TUNING_PARTICLES = 600, 200
KERNEL = 0.23  # h, width of the kernel as a share of the parameters' deviation: a discount of 0.95
STATES = 5  # theta [deg], f [deg / s], and a, b, c over the identified ones
MOST_EVALUATIONS = 150  # of the likelihood, in a tuning


class Cloud(NamedTuple):
    """Particles of B filters, P each."""

    sample: int  # number of the latest sample
    particles: Array  # (STATES, B, P)
    weights: Array  # (B, P), their sum is 1
    log_likelihood: Array  # (B,) of all measurements


@dataclasses.dataclass(frozen=True)
class BootstrapFilter(Estimator[Cloud]):
    """Parameters of the particle filter.

    All filters of a batch have the same random numbers, which follow from seed and sample alone: a batch is
    its single filters.

    Attributes:
        model: identified model.
        sample_time: T [s].
        process_deviation: of v [deg] and of w [deg / s] per sample, and of a parameter's share per square
            root of a millimetre of travel.
        initial_deviation: of theta [deg], of f [deg / s] and of the logarithm of a parameter at first.
        measurement_variance: R [deg^2], one for all filters or (B,).
        count: P, number of particles.
        seed: of the random numbers.
    """

    model: ColemanHodgdon
    sample_time: float
    process_deviation: tuple[float, float, float] = (0.1, 0.1, 0.02)
    initial_deviation: tuple[float, float, float] = (10.0, 1.0, 0.1)
    measurement_variance: ArrayLike = 0.1
    count: int = PARTICLES
    seed: int = 0

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def over(self, elapsed_s: float) -> Self:
        """Return the filter of another T [s]; the variances of v and w grow with the time."""
        longer = float(np.sqrt(elapsed_s / self.sample_time))
        of_bend, of_error, of_parameter = self.process_deviation
        deviation = (of_bend * longer, of_error * longer, of_parameter)
        return dataclasses.replace(self, sample_time=elapsed_s, process_deviation=deviation)

    def start(self, pull_mm: Array, bend_deg: Array) -> Cloud:
        """Return the particles at the first sample, about the initial estimate."""
        of_bend, of_error, of_parameter = self.initial_deviation
        rng = random_stream(self.seed, SeedUse.PARTICLES)
        drawn = rng.standard_normal((STATES, self.count))
        drawn[0] *= of_bend
        drawn[1] *= of_error
        drawn[2:] = np.exp(of_parameter * drawn[2:])
        particles = np.repeat(drawn[:, None], bend_deg.size, axis=1)
        particles[0] += bend_deg[:, None]
        weights = np.full(particles.shape[1:], 1 / self.count)
        return Cloud(0, particles, weights, np.zeros(bend_deg.size))

    def predict(self, cloud: Cloud, pull_mm: Array, previous_pull_mm: Array) -> Cloud:
        """Draw particles again where few of them count, and advance all by one sample."""
        sample = cloud.sample + 1
        rng = random_stream(self.seed, SeedUse.PARTICLES, sample)
        of_bend, of_error, of_parameter = self.process_deviation
        noise = rng.standard_normal((STATES, self.count))
        particles, weights = self._resampled(cloud, rng)
        bend, error, a, b, c = particles
        pull, travel = pull_mm[:, None], (pull_mm - previous_pull_mm)[:, None]
        if of_parameter:
            particles[2:] *= 1 + of_parameter * noise[2:, None] * np.sqrt(np.abs(travel))
        a_per_mm, b_deg_per_mm, c_deg_per_mm = (
            np.asarray(of) for of in (self.model.a_per_mm, self.model.b_deg_per_mm, self.model.c_deg_per_mm)
        )
        moved = (b_deg_per_mm * pull) * b
        moved -= bend
        moved *= a
        moved *= a_per_mm * np.abs(travel)
        moved += (c_deg_per_mm * travel) * c
        moved += self.sample_time * error
        bend += moved
        bend += of_bend * noise[0]
        error += of_error * noise[1]
        return Cloud(sample, particles, weights, cloud.log_likelihood)

    def update(self, cloud: Cloud, measurement_deg: Array) -> Cloud:
        """Weight the particles by one measurement."""
        missing = np.isnan(measurement_deg)
        variance = np.broadcast_to(np.asarray(self.measurement_variance, float), missing.shape)
        log = np.where(missing, 0.0, measurement_deg)[:, None] - cloud.particles[0]
        log *= log
        log *= np.where(missing, 0.0, -0.5 / variance)[:, None]
        most = log.max(axis=1)
        log -= most[:, None]
        weights = np.exp(log, out=log)
        weights *= cloud.weights
        total = weights.sum(axis=1)
        weights /= total[:, None]
        likelihood = most + np.log(total) - 0.5 * np.log(2 * np.pi * variance)
        return cloud._replace(
            weights=weights, log_likelihood=cloud.log_likelihood + np.where(missing, 0.0, likelihood)
        )

    def step(self, state: Cloud, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array) -> Cloud:
        """Predict and update by one sample."""
        return self.update(self.predict(state, pull_mm, previous_pull_mm), measurement_deg)

    def bend_deg(self, state: Cloud) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        return weighted_mean(state.weights, state.particles[0])

    def half_width_deg(self, state: Cloud) -> Array:
        """Return half of the (B,) 95 % intervals of a normal distribution of their variance [deg]."""
        away = state.particles[0] - self.bend_deg(state)[:, None]
        return half_width_of(weighted_mean(state.weights, away * away))

    def _resampled(self, cloud: Cloud, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return particles and weights, drawn again in filters where fewer than half of them count."""
        weights = cloud.weights
        few = (np.einsum("bp,bp->b", weights, weights) * self.count > 2)[:, None]
        offset, kernel = rng.random(), rng.standard_normal((STATES - 2, 1, self.count))
        weights = np.where(few, weights, 1 / self.count)  # where they stay, each is drawn once
        particles = cloud.particles.reshape(STATES, -1).take(systematic(weights, offset), axis=1)
        particles = particles.reshape(cloud.particles.shape)
        own, before = particles[2:], cloud.particles[2:]
        mean = weighted_mean(weights, before)
        variance = np.einsum("bp,ibp,ibp->ib", weights, before, before) - mean**2
        kept = np.where(few, np.sqrt(1 - KERNEL**2), 1.0)
        own *= kept
        own += ((1 - kept[:, 0]) * mean)[..., None]
        own += np.where(few, KERNEL * np.sqrt(np.maximum(variance, 0.0))[..., None], 0.0) * kernel
        return particles, np.where(few, 1 / self.count, cloud.weights)


def weighted_mean(weights: Array, values: Array) -> Array:
    """Return the mean (..., B) of values (..., B, P), by weights (B, P)."""
    mean: Array = np.einsum("bp,...bp->...b", weights, values)
    return mean


def systematic(weights: Array, offset: float) -> NDArray[np.intp]:
    """Return B x P places of particles, drawn by their weights (B, P), one from each of P equal strata.

    A particle of weight w is drawn floor(P w) or ceil(P w) times; `offset` in [0, 1) determines which.
    """
    count = weights.shape[1]
    upto = np.ceil(np.cumsum(weights, axis=1) * count - offset).astype(np.intp)
    upto[:, -1] = count
    times = np.diff(np.minimum(upto, count), axis=1, prepend=0)
    return np.repeat(np.arange(times.size), times.ravel())


@dataclasses.dataclass(frozen=True)
class ParticleFit:
    """Deviations of a particle filter that make measurements most likely."""

    key: str  # name in the file of fits
    on_twins: bool = False  # measurements of randomised twins, instead of the training records

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return the deviations by the names of the fields of `BootstrapFilter`."""
        begin = dataclasses.replace(self._begin(knowledge), count=TUNING_PARTICLES)
        if not self.on_twins:
            begin = dataclasses.replace(begin, measurement_variance=knowledge.task.noise_level)
            return tune(begin, draw_training_episodes(knowledge.task, knowledge.seed))
        episodes, variance = draw_twin_episodes(knowledge)
        return tune(dataclasses.replace(begin, measurement_variance=variance), episodes)

    def filter(self, knowledge: Knowledge) -> BootstrapFilter:
        """Return the filter with the fitted deviations."""
        found: dict[str, Any] = {name: tuple(of) for name, of in knowledge.found(self).items()}
        return dataclasses.replace(self._begin(knowledge), **found)

    def _begin(self, knowledge: Knowledge) -> BootstrapFilter:
        model = knowledge.reference
        assert isinstance(model, ColemanHodgdon)
        return BootstrapFilter(model, knowledge.sample_time, seed=knowledge.seed)


def tune(begin: BootstrapFilter, episodes: TrainingEpisodes) -> dict[str, Any]:
    """Return the deviations of greatest likelihood; random numbers are the same at every evaluation."""

    def deviations(logarithms: Array) -> dict[str, tuple[float, ...]]:
        of = np.exp(np.clip(logarithms, -12, 5)).tolist()
        return {"process_deviation": tuple(of[:3]), "initial_deviation": tuple(of[3:])}

    def cost(logarithms: Array) -> float:
        filter_: Any = dataclasses.replace(begin, **deviations(logarithms))  # type: ignore[arg-type]
        return -log_likelihood(filter_, *episodes[:3])

    start = np.log([*begin.process_deviation, *begin.initial_deviation])
    found = nelder_mead(cost, start, step=1.0, xatol=0.05, fatol=0.5, maxfev=MOST_EVALUATIONS)
    return {name: list(of) for name, of in deviations(found).items()}


def log_likelihood(
    filter_: BootstrapFilter, pull_mm: Array, measurement_deg: Array, initial_bend_deg: Array
) -> float:
    """Return the log-likelihood of all measurements after the first, summed over (B, N) records."""
    pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
    cloud = filter_.start(pull[0], initial)
    for k in range(1, len(measurement)):
        cloud = filter_.step(cloud, pull[k], pull[k - 1], measurement[k])
    return float(cloud.log_likelihood.sum())


TUNED, TUNED_ON_TWINS = ParticleFit("particles"), ParticleFit("particles, on twins", on_twins=True)
MODEL = (ColemanHodgdon.name,)

register_method(MethodSpec("PF-tuned", TUNED.filter, ("R",), models=MODEL, fits=(TUNED,)))
register_method(
    MethodSpec(
        "PF-tuned (twins)", TUNED_ON_TWINS.filter, ("R", "ranges"), models=MODEL, fits=(TUNED_ON_TWINS,)
    )
)
