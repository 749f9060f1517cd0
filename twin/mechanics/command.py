"""Command signal of a simulation: checked, at every sample and at every control period."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.preset.preset import Preset
from twin.preset.sample_time import check_sample_time
from twin.signals.excitation import approach, check_finite

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Command:
    """Checked input of a simulation, at every sample and at every control period.

    Attributes:
        preset: parameters of the endoscope.
        sample_time: time between two samples [s].
        pull: commanded pulling distance of wire a at each sample, (N,) [m].
        lateral_pull: commanded pulling distance of wire c at each sample, (N,) [m].
        sheath_bend: bend angle of the sheath at each sample, (N,) [rad].
        before: pull [m], lateral pull [m] and sheath bend [rad] at each control period before the first
            sample, (M, 3).
        between: the same at each control period from the previous sample to this one, (N, periods, 3); not
            used for the first sample.
    """

    preset: Preset
    sample_time: float
    pull: Array
    lateral_pull: Array
    sheath_bend: Array
    before: Array
    between: Array

    @classmethod
    def of(
        cls,
        preset: Preset,
        pull: Array,
        sample_time: float,
        lateral_pull: Array | None = None,
        sheath_bend: Array | float | None = None,
    ) -> "Command":
        """Check the signals of a run and interpolate them to the control periods; see `simulate`."""
        pull = np.asarray(pull, dtype=float)
        check_finite(pull)
        if lateral_pull is None:
            lateral_pull = np.full(
                len(pull), preset.lateral_command_zero if preset.bending_planes == 2 else 0.0
            )
        elif preset.bending_planes == 1:
            raise InputError(f"a lateral command: {preset.name!r} has one bending plane, it needs two")
        lateral_pull = np.asarray(lateral_pull, dtype=float)
        check_finite(lateral_pull)
        bend = np.asarray(preset.sheath_bend if sheath_bend is None else sheath_bend, dtype=float)
        if bend.ndim == 0:
            bend = np.full(len(pull), bend)
        for name, values in (("lateral command", lateral_pull), ("bend of the sheath", bend)):
            if values.shape != pull.shape:
                raise InputError(f"{name} has {values.size} samples, the command has {len(pull)}")
        if not (np.isfinite(bend).all() and (bend >= 0).all()):
            wrong = bend[~(np.isfinite(bend) & (bend >= 0))][0]
            raise InputError(f"the sheath's bend is {wrong:g} rad: every sample must be finite, not negative")

        periods = check_sample_time(preset, sample_time)
        samples = np.stack([pull, lateral_pull, bend], axis=1)
        share = np.arange(1, periods + 1)[:, None] / periods
        between = np.empty((len(pull), periods, 3))
        between[1:] = samples[:-1, None] * (1 - share) + samples[1:, None] * share
        between[:, -1] = samples
        return cls(preset, sample_time, pull, lateral_pull, bend, _approach(samples[0], preset), between)


def _approach(first: Array, preset: Preset) -> Array:
    """Return the inputs (M, 3) on the way from rest to the first sample; the shorter way waits at rest."""
    zeros = preset.command_zeros
    ways = [approach(start - zero, preset.control_period) for start, zero in zip(first, zeros, strict=False)]
    inputs = np.zeros((max(map(len, ways)), 3))
    for column, (way, zero) in enumerate(zip(ways, zeros, strict=True)):
        inputs[:, column] = zero
        inputs[len(inputs) - len(way) :, column] += way
    inputs[:, 2] = first[2]
    return inputs
