"""Derivatives of a record with respect to parameters: batched differences of reduced twins."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.preset.preset import Preset, parameter_limits
from twin.reduced.simulate import simulate, simulate_batch

Array = NDArray[np.float64]

SHARE = 1e-4
"""Step of a parameter as a share of its value: far above what equilibrium leaves open, far below a loop."""


@dataclasses.dataclass(frozen=True)
class Derivatives:
    """A record and how it changes with the parameters of its endoscope.

    Attributes:
        record: at the parameters themselves.
        bend: (N, P) change of the bend with each parameter [rad per unit of the parameter].
        lateral_bend: (N, P) the same of the second plane; zero with one plane.
    """

    record: Episode
    bend: Array
    lateral_bend: Array


def derivatives(
    preset: Preset,
    pull: Array,
    sample_time: float,
    names: Sequence[str],
    *,
    lateral_pull: Array | None = None,
    sheath_bend: Array | float | None = None,
    steps: Mapping[str, float] | None = None,
    threads: int = 0,
) -> Derivatives:
    """Return a record and its derivatives with respect to parameters, by differences of second order.

    They are central, but one-sided where a parameter is at its limit. All records run side by side.

    Args:
        preset: the endoscope.
        pull: (N,) commanded pulling distance of wire a [m], as `simulate` takes it.
        sample_time: time between two samples [s].
        names: P parameters of the preset.
        lateral_pull: (N,) of wire c [m].
        sheath_bend: (N,) or one angle [rad].
        steps: of parameters, in their units; without one, a ten-thousandth of the value.
        threads: number of threads; 0 for one per core.

    Raises:
        ValueError: a name is unknown, a parameter is a whole number, is 0 and has no step, or a step leaves
            its limits.
        FloatingPointError: an endoscope did not converge to equilibrium.
    """
    presets, shares = [preset], []
    for name in names:
        given = (steps or {}).get(name)
        moved, weights = _stencil(preset, name, given)
        presets += [preset.replace(**{name: value}) for value in moved]
        shares.append(weights)
    count = len(presets)
    records = simulate_batch(
        presets,
        [pull] * count,
        sample_time,
        lateral_pulls=[lateral_pull] * count,
        sheath_bends=[sheath_bend] * count,
        threads=threads,
    )
    inputs: dict[str, Any] = {"lateral_pull": lateral_pull, "sheath_bend": sheath_bend}
    # Of one without equilibrium, another run says by how much it was missed.
    whole = [
        simulate(one, pull, sample_time, **inputs) if record is None else record
        for one, record in zip(presets, records, strict=True)
    ]
    changes = [
        _weighed([whole[0], whole[1 + 2 * place], whole[2 + 2 * place]], weights)
        for place, weights in enumerate(shares)
    ]
    bend, lateral = (np.stack(columns, axis=1) for columns in zip(*changes, strict=True))
    return Derivatives(whole[0], bend, lateral)


def _stencil(preset: Preset, name: str, step: float | None) -> tuple[list[float], Array]:
    """Return two values of a parameter beside its own, and the weights (3,) of the records at all three."""
    low, high = parameter_limits(name)
    if isinstance(getattr(preset, name), int):
        raise InputError(f"{name} is a whole number: it has no derivative")
    value = float(getattr(preset, name))
    if step is None:
        step = SHARE * abs(value)
    if not (step > 0 and np.isfinite(step)):
        raise InputError(f"{name} = {value:g} has a step of {step:g}: give a positive one in its unit")
    if low <= value - step and value + step <= high:
        return [value + step, value - step], np.array([0.0, 0.5, -0.5]) / step
    side = step if value + 2 * step <= high else -step
    if not low <= value + 2 * side <= high:
        raise InputError(
            f"{name} = {value:g} cannot take steps of {step:g}: its limits are {low:g} to {high:g}"
        )
    return [value + side, value + 2 * side], np.array([-1.5, 2.0, -0.5]) / side


def _weighed(records: Sequence[Episode], weights: Array) -> tuple[Array, Array]:
    """Return the weighed sums of bends and lateral bends, both (N,)."""
    bend: Array = sum(weight * record.bend for weight, record in zip(weights, records, strict=True))
    if not len(records[0].lateral_bend):
        return bend, np.zeros_like(bend)
    lateral: Array = sum(
        weight * record.lateral_bend for weight, record in zip(weights, records, strict=True)
    )
    return bend, lateral
