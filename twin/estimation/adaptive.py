"""Tuned active models that adapt: to outliers, an unknown R, a bias of the sensor, a model that may be off.

Huber's update (`RobustActiveModel`), R by variational Bayes (`AdaptiveActiveModel`), the bias as third state
(`BiasedActiveModel`), and filters of different Q as interacting models (`InteractingModels`).
"""

import dataclasses
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.active_model import ANGLE, ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import Belief, condition, half_width_of, innovation_of
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.tuning import TUNED, TUNED_ON_TWINS, register_likelihood

Array = NDArray[np.float64]
HUBER_THRESHOLD = 1.345  # 95 % as efficient as least squares where the noise is Gaussian (Huber 1964)
ITERATIONS = 5  # of the fixed point of R and the update
BIASED_ANGLE = np.array([1.0, 0.0, 1.0])  # the sensor sees the sum of angle and bias


@dataclasses.dataclass(frozen=True)
class RobustActiveModel(ActiveModel):
    """The active model with Huber's update: a measurement far from the prediction counts for less.

    Huber 1964; in Kalman filters Boncelet and Dickinson 1983, Karlgaard 2015. The updated state minimises

        (x - x_k|k-1)' P^-1 (x - x_k|k-1) / 2 + rho((y - theta) / sqrt(R)),

    where rho(z) is z^2 / 2 up to the threshold k and rises linearly beyond it. The prediction stays Gaussian:
    errors of the first angle or of the model make measurements look like outliers too.
    """

    # k: standard deviations sqrt(R) that the residual after the update may have at full weight; infinite: the
    # active model
    threshold: float = HUBER_THRESHOLD

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement, its variance inflated where it is far off."""
        innovation, spread = innovation_of(belief.mean, belief.covariance, ANGLE, measurement_deg)
        R = np.asarray(self.measurement_variance, dtype=float)
        variance = huber_variance(np.abs(innovation), spread, R, self.threshold)
        mean, covariance = condition(belief.mean, belief.covariance, ANGLE, measurement_deg, variance)
        return Belief(mean, covariance, belief.memory)


def huber_variance(distance: Array, spread: Array, variance: Array, threshold: float) -> Array:
    """Return the variance with which a Kalman update is Huber's.

    Reweighting sets R / w with w = k sqrt(R) / |r| where the residual r = nu R_w / (P + R_w) is too large,
    and repeats. With one scalar measurement the fixed point is R_w = |nu| sqrt(R) / k - P.

    `distance` (B,) is |nu| [deg], NaN where there is no measurement; `spread` (B,) is P [deg^2], `variance`
    is R, scalar or (B,), and `threshold` k.
    """
    inflated = np.nan_to_num(distance) * np.sqrt(variance) / threshold - spread
    return np.maximum(variance, inflated)


class AdaptiveBelief(NamedTuple):
    """Belief in the state of B filters and in the variance of their measurements."""

    state: Belief  # belief in angle and model error
    shape: Array  # alpha, (B,)
    scale: Array  # beta, (B,) [deg^2]

    @property
    def measurement_variance(self) -> Array:
        """(B,) R [deg^2]."""
        return self.scale / self.shape


@dataclasses.dataclass(frozen=True)
class AdaptiveActiveModel(Estimator[AdaptiveBelief]):
    """The active model that finds R itself, by variational Bayes (Sarkka and Nummenmaa 2009).

    R has an inverse-gamma belief of shape alpha and scale beta. Each measurement, with forgetting rho,

        alpha <- rho alpha + 1 / 2,    beta <- rho beta + ((y - theta)^2 + P_theta) / 2,    R = beta / alpha,

    where theta and P_theta are those after an update with this very R: a fixed point, found by iteration.
    What the filter cannot explain, an error of its model too, counts as noise of the sensor.
    """

    active_model: ActiveModel  # the filter; its R, or that of the sensor, is the first guess
    forgetting: float = 0.98  # rho: share of evidence kept after a measurement, of 1 / (1 - rho) of them
    first_shape: float = 25.0  # alpha at first: the guess weighs as 2 alpha measurements; 0.98 settles at 25

    def __post_init__(self) -> None:
        if not 0 < self.forgetting <= 1:
            raise InputError(f"forgetting = {self.forgetting}: must be above 0 and at most 1")
        if not self.first_shape > 0:
            raise InputError(f"first_shape = {self.first_shape}: must be positive")

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that begins at the sensor's variance."""
        return dataclasses.replace(self, active_model=self.active_model.with_sensor(sensor))

    def over(self, elapsed_s: float) -> Self:
        """Return the filter of another T [s]."""
        return dataclasses.replace(self, active_model=self.active_model.over(elapsed_s))

    def start(self, pull_mm: Array, bend_deg: Array) -> AdaptiveBelief:
        """Return the belief at the first sample."""
        shape = np.full(bend_deg.size, float(self.first_shape))
        scale = shape * np.asarray(self.active_model.measurement_variance, dtype=float)
        return AdaptiveBelief(self.active_model.start(pull_mm, bend_deg), shape, scale)

    def step(
        self, state: AdaptiveBelief, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> AdaptiveBelief:
        """Predict, then find the update and R together; without a measurement nothing of R is forgotten."""
        predicted = self.active_model.predict(state.state, pull_mm, previous_pull_mm)
        seen = ~np.isnan(measurement_deg)
        shape = np.where(seen, self.forgetting * state.shape + 0.5, state.shape)
        kept = self.forgetting * state.scale
        innovation, spread = innovation_of(predicted.mean, predicted.covariance, ANGLE, measurement_deg)
        innovation = np.where(seen, innovation, 0.0)
        scale = kept
        for _ in range(ITERATIONS):
            variance = scale / shape
            left = variance / (spread + variance)  # share of innovation and spread that this update leaves
            scale = kept + ((left * innovation) ** 2 + left * spread) / 2
        updated = dataclasses.replace(self.active_model, measurement_variance=variance).update(
            predicted, measurement_deg
        )
        return AdaptiveBelief(updated, shape, np.where(seen, scale, state.scale))

    def bend_deg(self, state: AdaptiveBelief) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        return self.active_model.bend_deg(state.state)

    def half_width_deg(self, state: AdaptiveBelief) -> Array:
        """Return half of the (B,) 95 % intervals of the filter [deg]."""
        return self.active_model.half_width_deg(state.state)


@dataclasses.dataclass(frozen=True)
class BiasedActiveModel(ActiveModel):
    """The active model with the sensor's bias as third state: y = theta + bias + noise (Friedland 1969).

    The state is X = [theta, f, bias]. A measurement sees the sum of angle and bias alone; the model pins the
    absolute angle: Coleman and Hodgdon's draws theta towards b l wherever the tendon moves. An error in the
    model's level therefore counts as a bias, and so does a wrong first angle that `initial_variance` trusts.
    """

    bias_variance: ArrayLike = 1.0  # of the bias at the first sample, where zero is expected [deg^2]
    # of its random walk, per sample; 1e-6 is 0.02 deg in a minute at 0.1 s, zero a constant [deg^2]
    bias_process_variance: float = 1e-6

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R, and knows its zero that well."""
        variance = np.square(np.asarray(sensor.zero_deviation_deg, float))
        return dataclasses.replace(super().with_sensor(sensor), bias_variance=variance)

    def over(self, elapsed_s: float) -> Self:
        """Return the filter of another T [s]; all variances of random walks grow with the time."""
        of_bias = self.bias_process_variance * elapsed_s / self.sample_time
        return dataclasses.replace(super().over(elapsed_s), bias_process_variance=of_bias)

    def start(self, pull_mm: Array, bend_deg: Array) -> Belief:
        """Return the belief at the first sample: no known error of the model and no known bias."""
        pair = super().start(pull_mm, bend_deg)
        mean = np.concatenate([pair.mean, np.zeros((1, bend_deg.size))])
        covariance = np.zeros((3, 3, bend_deg.size))
        covariance[:2, :2] = pair.covariance
        covariance[2, 2] = self.bias_variance
        return Belief(mean, covariance, pair.memory)

    def resume(self, trusted: Belief, now: Belief, pull_mm: Array, bend_deg: Array) -> Belief:
        """Restart with the known bias: it takes minutes to find."""
        belief = self.start(pull_mm, bend_deg - trusted.mean[2])
        belief.mean[2] = trusted.mean[2]
        belief.covariance[2, 2] = trusted.covariance[2, 2]
        return belief

    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by one sample: angle and error as the active model does, the bias stays."""
        pair = Belief(belief.mean[:2], belief.covariance[:2, :2], belief.memory)
        ahead = super().predict(pair, pull_mm, previous_pull_mm)
        slope = self.model.slope(belief.mean[0], pull_mm, previous_pull_mm)
        with_angle, with_error = belief.covariance[0, 2], belief.covariance[1, 2]
        covariance = np.empty_like(belief.covariance)
        covariance[:2, :2] = ahead.covariance
        covariance[0, 2] = covariance[2, 0] = slope * with_angle + self.sample_time * with_error
        covariance[1, 2] = covariance[2, 1] = with_error
        covariance[2, 2] = belief.covariance[2, 2] + self.bias_process_variance
        return Belief(np.concatenate([ahead.mean, belief.mean[2:]]), covariance, ahead.memory)

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement of the angle and the bias together."""
        mean, covariance = condition(
            belief.mean, belief.covariance, BIASED_ANGLE, measurement_deg, self.measurement_variance
        )
        return Belief(mean, covariance, belief.memory)


class InteractingState(NamedTuple):
    """Beliefs of K filters, each of B records, and their (K, B) probabilities."""

    beliefs: tuple[Belief, ...]
    probability: Array


@dataclasses.dataclass(frozen=True)
class InteractingModels(Estimator[InteractingState]):
    """Active models of different Q, weighed by what they explain (Blom and Bar-Shalom 1988).

    Between samples a device may go from one model to another by a Markov chain: the beliefs are mixed by its
    probabilities, each filter takes its step, and the probability of each is multiplied by the likelihood of
    the measurement under it.
    """

    filters: tuple[ActiveModel, ...]  # K of them
    stays: float = 0.95  # probability that the same one holds at the next sample

    def __post_init__(self) -> None:
        if len(self.filters) < 2:
            raise InputError(f"{len(self.filters)} filters: interacting models are at least two")
        if not 0 < self.stays < 1:
            raise InputError(f"stays = {self.stays}: must be above 0 and below 1")

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filters that take the sensor's variance as R."""
        return dataclasses.replace(self, filters=tuple(of.with_sensor(sensor) for of in self.filters))

    def over(self, elapsed_s: float) -> Self:
        """Return the filters of another T [s]."""
        return dataclasses.replace(self, filters=tuple(of.over(elapsed_s) for of in self.filters))

    def start(self, pull_mm: Array, bend_deg: Array) -> InteractingState:
        """Return the state at the first sample: all filters are equally likely."""
        count = len(self.filters)
        beliefs = tuple(of.start(pull_mm, bend_deg) for of in self.filters)
        return InteractingState(beliefs, np.full((count, bend_deg.size), 1 / count))

    def step(
        self, state: InteractingState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> InteractingState:
        """Mix, predict, update and weigh by one sample."""
        count = len(self.filters)
        chain = np.full((count, count), (1 - self.stays) / (count - 1))
        np.fill_diagonal(chain, self.stays)
        prior = chain.T @ state.probability
        beliefs, logs = [], []
        for place, filter_ in enumerate(self.filters):
            shares = chain[:, place, None] * state.probability / prior[place]
            belief = filter_.predict(_mixed(state.beliefs, shares, place), pull_mm, previous_pull_mm)
            logs.append(filter_.log_likelihood(belief, measurement_deg))
            beliefs.append(filter_.update(belief, measurement_deg))
        likelihood = np.array(logs)
        weights = prior * np.exp(likelihood - likelihood.max(axis=0))
        return InteractingState(tuple(beliefs), weights / weights.sum(axis=0))

    def bend_deg(self, state: InteractingState) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        bend: Array = np.sum(state.probability * [of.mean[0] for of in state.beliefs], axis=0)
        return bend

    def half_width_deg(self, state: InteractingState) -> Array:
        """Return half of the (B,) 95 % intervals of a normal distribution of the mixture's variance [deg]."""
        angle = np.array([of.mean[0] for of in state.beliefs])
        within = np.array([of.covariance[0, 0] for of in state.beliefs])
        away = angle - self.bend_deg(state)
        return half_width_of(np.sum(state.probability * (within + away**2), axis=0))


def _mixed(beliefs: tuple[Belief, ...], shares: Array, place: int) -> Belief:
    """Return the beliefs of all filters in (K, B) shares as one, with the model's memory of one place."""
    means = np.array([of.mean for of in beliefs])
    mean = np.einsum("kb,knb->nb", shares, means)
    away = means - mean
    covariances = np.array([of.covariance for of in beliefs]) + away[:, :, None] * away[:, None, :]
    return Belief(mean, np.einsum("kb,knmb->nmb", shares, covariances), beliefs[place].memory)


register_likelihood("Huber", TUNED, RobustActiveModel)
register_likelihood("AM with bias", TUNED, BiasedActiveModel, given=("R", "zero"))
register_method(
    MethodSpec(
        name="VB",
        build=lambda known: AdaptiveActiveModel(TUNED.filter(known)),
        given=("R",),
        models=(TUNED.model,),
        fits=(TUNED,),
    )
)
register_method(
    MethodSpec(
        name="IMM",
        build=lambda known: InteractingModels((TUNED.filter(known), TUNED_ON_TWINS.filter(known))),
        given=("R", "ranges"),
        models=(TUNED.model,),
        fits=(TUNED, TUNED_ON_TWINS),
    )
)
