"""The limit: an ensemble of randomised twins, driven by the command and weighed by the measurements.

The angle is sought among the affine combinations of the members: angle_k = mean_k + c . anomaly_k, where the
coefficients c do not change with time and are normal before anything is measured, so that mean and covariance
of the angle over all times are those of the ensemble. Each measurement then updates c: an ensemble Kalman
filter in the space of the weights (Evensen 2003; Hunt et al. 2007), whose members are simulated once, for
every noise and seed.

Told the density of the noise, it moves c by the score of the innovation, as Masreliez (1975) does, where its
belief is narrow, and by the best linear update of that noise where it is not. Its covariance shrinks by the
mean slope of the score, not by the slope at the innovation: so all filters of one noise share it.

It knows the physics and the ranges of its parameters. Among linear estimators that know no more it is the
best, but for the finite number of members; a nonlinear one can do somewhat better, as twins are not normal.
"""

import dataclasses
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import half_width_of

if TYPE_CHECKING:
    from twin.signals.noise_density import NoiseDensity

Array = NDArray[np.float64]
NARROW = 0.5  # of the noise's standard deviation: narrower beliefs are moved by the score


class EnsembleState(NamedTuple):
    """Coefficients of B filters, and the covariance that they share, as all know the same noise.

    Attributes:
        sample: number of the latest sample.
        mean: (M, B) of the coefficients.
        covariance: (M, M) of the coefficients.
    """

    sample: int
    mean: Array
    covariance: Array


@dataclasses.dataclass(frozen=True)
class EnsembleFilter(Estimator[EnsembleState]):
    """An ensemble along one command: all B filters follow that command and have one sensor.

    Attributes:
        members_deg: (M, N) angle of each member at each sample of the command [deg].
        measurement_variance: R [deg^2].
        density: what else is known of the noise; without it, it is taken as normal, of mean zero and variance
            R.
        bias_deviations: standard deviation of the mean of the noise, which is then one more coefficient, in
            units of sqrt(R); 0 where it is known to be zero.
    """

    members_deg: Array
    measurement_variance: float = 0.1
    density: "NoiseDensity | None" = None
    bias_deviations: float = 0.0

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R.

        Raises:
            ValueError: the filters of the batch have different sensors.
        """
        variances = np.unique(sensor.variance)
        if variances.size > 1:
            raise InputError(f"an ensemble has one sensor for all its filters, not R = {variances.tolist()}")
        return dataclasses.replace(self, measurement_variance=float(variances[0]))

    def start(self, pull_mm: Array, bend_deg: Array) -> EnsembleState:
        """Return the state at the first sample; the command says more than the initial estimate, unused."""
        count = len(self.members_deg) + bool(self.bias_deviations)
        return EnsembleState(0, np.zeros((count, bend_deg.size)), np.eye(count))

    def step(
        self, state: EnsembleState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> EnsembleState:
        """Weigh the members by one measurement, which is there for all filters or for none.

        Beyond the end of the command the members stand where they ended.

        Raises:
            ValueError: it is there for some of them only.
        """
        sample = min(state.sample + 1, self.members_deg.shape[1] - 1)
        if not sole_measurement(measurement_deg):
            return state._replace(sample=sample)
        mean, anomaly = self.mean_and_anomaly(sample)
        seen = self._with_bias(anomaly, self.bias_deviations * np.sqrt(self.measurement_variance))
        towards = state.covariance @ seen  # covariance of the coefficients with what is seen
        spread = float(np.sqrt(max(float(seen @ towards), 0.0)))
        score, information = self.weigh(measurement_deg - mean - seen @ state.mean, spread)
        return EnsembleState(
            sample,
            state.mean + np.outer(towards, score),
            state.covariance - np.outer(towards, information * towards),
        )

    def bend_deg(self, state: EnsembleState) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        mean, anomaly = self.mean_and_anomaly(state.sample)
        return mean + self._with_bias(anomaly) @ state.mean

    @property
    def states_interval(self) -> bool:
        """True: the members that are left differ by what is not known, if the twin is like them."""
        return True

    def half_width_deg(self, state: EnsembleState) -> Array:
        """Return half of the (B,) 95 % intervals of the belief [deg], one for all filters."""
        angle = self._with_bias(self.mean_and_anomaly(state.sample)[1])
        return np.full(state.mean.shape[1], half_width_of(angle @ state.covariance @ angle))

    def _with_bias(self, anomaly: Array, of_bias: float = 0.0) -> Array:
        """Return what the coefficients are multiplied by, where the mean of the noise is one of them."""
        return np.append(anomaly, of_bias) if self.bias_deviations else anomaly

    def weigh(self, innovation: Array, spread: float) -> tuple[Array, float]:
        """Return the (B,) scores of innovations, and their information, for a belief of this deviation."""
        density = self.density
        if density is None:
            information = 1 / (spread**2 + self.measurement_variance)
            return innovation * information, information
        if spread > NARROW * np.sqrt(density.variance):
            # The belief may have two peaks then, the angle and an outlier; the best linear update is safe.
            information = 1 / (spread**2 + density.variance)
            return (innovation - density.mean) * information, information
        return density.score(innovation, spread), density.information(spread)

    def log_likelihood(self, innovation: Array, spread: float) -> Array:
        """Return the log-density of innovations [of 1 / deg] for a belief of this deviation.

        Where the density of the noise is rough, it is a normal one of the same mean and variance.
        """
        density = self.density
        if density is not None and not density.rough:
            return density.log_density(innovation, spread)
        mean, variance = (density.mean, density.variance) if density else (0.0, self.measurement_variance)
        whole = spread**2 + variance
        found: Array = -0.5 * ((innovation - mean) ** 2 / whole + np.log(2 * np.pi * whole))
        return found

    def mean_and_anomaly(self, sample: int) -> tuple[float, Array]:
        """Return the mean of the members at a sample [deg], and what each is off by, over sqrt(M - 1)."""
        members = self.members_deg[:, sample].astype(float)
        mean = float(members.mean())
        return mean, (members - mean) / np.sqrt(len(members) - 1)


def sole_measurement(measurement_deg: Array) -> bool:
    """Return whether a sample was measured, by all filters or by none.

    Raises:
        ValueError: some of them have a measurement, and some have none.
    """
    missing = np.isnan(measurement_deg)
    if missing.any() and not missing.all():
        raise InputError("filters of one ensemble must miss the same measurements")
    return not missing.any()


def posterior_bound(
    members_deg: Array, information: ArrayLike, seen: NDArray[np.bool_] | None = None
) -> Array:
    """Return the posterior Cramer-Rao bound of normal twins (Van Trees 1968; Tichavsky et al. 1998).

    If the angle were normal with the mean and covariance of the ensemble, no estimator would have a smaller
    mean square error over such twins. Real twins are not normal: an estimator may pass it. Fisher's
    information of each measurement adds to that of the coefficients before it.

    Args:
        members_deg: (M, N) ensemble along the command [deg].
        information: Fisher's information of one measurement about the angle [1 / deg^2].
        seen: (N,) where there is a measurement; else everywhere. The first sample is not measured.

    Returns:
        (N,) least standard deviation of the error [deg].
    """
    count, samples = members_deg.shape
    mean = members_deg.mean(axis=0)
    anomalies = ((members_deg - mean) / np.sqrt(count - 1)).T.astype(float)
    covariance = np.eye(count)
    bound = np.empty(samples)
    for k, anomaly in enumerate(anomalies):
        towards = covariance @ anomaly
        variance = float(anomaly @ towards)
        if k > 0 and (seen is None or seen[k]):
            covariance -= np.outer(towards, towards / (variance + 1 / np.asarray(information)))
            variance = variance / (1 + variance * float(np.asarray(information)))
        bound[k] = np.sqrt(max(variance, 0.0))
    return bound
