"""Bouc-Wen hysteresis model (Bouc 1971, Wen 1976), normalised as by Ikhouane and Rodellar (2007).

    theta = kappa_x l + kappa_w w
    dw = rho (dl - sigma |dl| |w|^(n-1) w + (sigma - 1) dl |w|^n),    sigma >= 1/2, n >= 1

with the pulling distance l in mm and the bending angle theta in degrees. w has no unit and saturates at +-1.
kappa_w is negative where the angle lags behind the pull, as in an endoscope. With n = 1 and sigma = 1 this is
the model of Coleman and Hodgdon: kappa_x = b, kappa_w = (c - b) / a, rho = a.

The angle is the state: with the pull it determines w. A filter that starts 60 deg off is therefore far
outside of saturation, where w^n is steep and an explicit step would overshoot without bound. The step here is
therefore implicit (backward Euler). Whatever the increment, it never crosses saturation, keeps the order of
two angles and never moves them apart; see `_advance`.
"""

import dataclasses
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.files.shown import shown
from twin.hysteresis.reading import numbers

Array = NDArray[np.float64]

HALLEY_STEPS = 3  # iterations of Halley's method: they reach 1e-14 for all n from 1 to 10 and any increment


@dataclasses.dataclass(frozen=True)
class BoucWen:
    """Bouc-Wen model: its parameters; arrays of one shape hold many candidates at once.

    Attributes:
        kappa_x_deg_per_mm: slope once w is saturated, positive [deg / mm].
        kappa_w_deg: half the height of a large loop, with its sign, not zero [deg].
        rho_per_mm: rate at which w changes with the pull, positive [1 / mm].
        sigma: shape, at least 1/2: 2 sigma rho is the slope of w just after a reversal from saturation.
        n: sharpness of the transition into saturation, at least 1.
    """

    name: ClassVar[str] = "bouc-wen"
    affine: ClassVar[bool] = False

    kappa_x_deg_per_mm: ArrayLike
    kappa_w_deg: ArrayLike
    rho_per_mm: ArrayLike
    sigma: ArrayLike
    n: ArrayLike

    def start(self, pull_mm: ArrayLike) -> Array:
        """Return the memory at the first sample, (0, B): empty, as the angle is the complete state."""
        return np.empty((0, np.size(pull_mm)))

    def step(
        self, bend_deg: Array, memory: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike
    ) -> tuple[Array, Array]:
        """Return angle (...,) [deg] and memory one sample later (backward Euler); see `HysteresisModel`."""
        previous = np.asarray(previous_pull_mm, dtype=float)
        increment = np.asarray(pull_mm, dtype=float) - previous
        w = self._internal(bend_deg, previous)
        w_next, _ = self._advance(w, increment)
        # As increments, so that a command at rest leaves the angle as it is, to the last bit.
        moved = np.asarray(self.kappa_x_deg_per_mm) * increment + np.asarray(self.kappa_w_deg) * (w_next - w)
        return bend_deg + moved, memory

    def slope(self, bend_deg: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike) -> Array:
        """Return the derivative of a step with respect to the angle, in (0, 1]."""
        previous = np.asarray(previous_pull_mm, dtype=float)
        increment = np.asarray(pull_mm, dtype=float) - previous
        w, gain = self._advance(self._internal(bend_deg, previous), increment)
        n = np.asarray(self.n)
        slope: Array = 1 / (1 + n * gain * np.abs(w) ** (n - 1))
        return slope

    def response(self, pull_mm: Array, bend_deg0: ArrayLike) -> Array:
        """Return the angle (candidates..., ..., N) [deg] along commands (..., N) [mm] from first angles.

        Parameters broadcast against `pull_mm` without time.
        """
        pull = np.moveaxis(np.asarray(pull_mm, dtype=float), -1, 0)
        kappa_x, kappa_w = np.asarray(self.kappa_x_deg_per_mm), np.asarray(self.kappa_w_deg)
        shapes = [np.shape(value) for value in dataclasses.astuple(self)]
        shape = np.broadcast_shapes(*shapes, pull.shape[1:], np.shape(bend_deg0))
        bend = np.empty((len(pull), *shape))  # time first: each step writes one block of memory
        bend[0] = bend_deg0
        w = self._internal(bend[0], pull[0])
        for k in range(1, len(bend)):
            w = self._advance(w, pull[k] - pull[k - 1])[0]
            bend[k] = kappa_x * pull[k] + kappa_w * w
        return np.moveaxis(bend, 0, -1)

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters by name."""
        return {name: float(np.asarray(value)) for name, value in dataclasses.asdict(self).items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "BoucWen":
        """Return the model with these parameters; raises `ValueError` where one is missing or wrong."""
        names = [field.name for field in dataclasses.fields(cls)]
        found = numbers(values, names)
        kappa_x, kappa_w, rho, sigma, n = found
        if not (np.isfinite(found).all() and kappa_x > 0 and kappa_w and rho > 0 and sigma >= 0.5 and n >= 1):
            raise InputError(
                f"{', '.join(names)} must be finite, kappa_x and rho positive, kappa_w not zero, "
                f"sigma at least 0.5 and n at least 1; got {shown(found)}"
            )
        return cls(*found)

    def _internal(self, bend_deg: ArrayLike, pull_mm: Array) -> Array:
        """Return the internal variable w at an angle [deg] and a pulling distance [mm]."""
        kappa_x, kappa_w = np.asarray(self.kappa_x_deg_per_mm), np.asarray(self.kappa_w_deg)
        w: Array = (np.asarray(bend_deg, dtype=float) - kappa_x * pull_mm) / kappa_w
        return w

    def _advance(self, w: Array, increment_mm: Array) -> tuple[Array, Array]:
        """Return w one sample later, and the factor of its power in the implicit equation.

        Seen along the motion, u = sign(dl) w follows du = h (1 - phi(u)) with h = rho |dl| and a rising
        phi(u) = u^n for u >= 0, -(2 sigma - 1) |u|^n below. Backward Euler is v + h phi(v) = u + h. Its
        left side rises at least as fast as v: one root, of derivative 1 / (1 + h phi'(v)).
        """
        rho, sigma, n = np.asarray(self.rho_per_mm), np.asarray(self.sigma), np.asarray(self.n)
        h = rho * np.abs(increment_mm)
        direction = np.where(increment_mm < 0, -1.0, 1.0)
        target = direction * w + h
        # The root has the sign of the right side; its size x solves x + gain x^n = size.
        size = np.abs(target)
        gain = np.where(target < 0, (2 * sigma - 1) * h, h)
        # Each term alone bounds x from above; from there Halley's method, of third order, does not miss.
        x = np.minimum(size, (size / np.maximum(gain, 1e-12)) ** (1 / n))
        for _ in range(HALLEY_STEPS):
            power = gain * x ** (n - 1)
            excess = x + power * x - size
            rise = 1 + n * power
            curvature = n * (n - 1) * power / np.maximum(x, 1e-200)
            x = x - 2 * excess * rise / (2 * rise**2 - excess * curvature)
        return direction * np.copysign(x, target), gain
