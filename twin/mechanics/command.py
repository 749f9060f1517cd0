"""Command signals of simulations, checked and at every control period, and the record of what followed."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode
from twin.errors import InputError
from twin.preset.preset import Preset, check_sample_time
from twin.signals.excitation import approach, check_finite

Array = NDArray[np.float64]
# Parameters that the endoscopes of a batch share: they set the shapes of its arrays, or its clock.
ALIKE = ("bending_planes", "vertebrae", "sheath_elements", "control_period")


def check_alike(presets: Sequence[Preset], names: Sequence[str] = ALIKE) -> None:
    """Refuse an empty batch, or endoscopes that differ in what they must share."""
    if not presets:
        raise InputError("a batch needs at least one endoscope")
    for name in names:
        if len({getattr(preset, name) for preset in presets}) > 1:
            raise InputError(f"the endoscopes of a batch must agree in {name}")


@dataclasses.dataclass(frozen=True)
class Command:
    """Checked input of a simulation, at every sample and at every control period."""

    preset: Preset
    sample_time: float  # [s]
    pull: Array  # (N,) commanded pulling distance of wire a at each sample [m]
    lateral_pull: Array  # (N,) of wire c [m]
    sheath_bend: Array  # (N,) bend angle of the sheath [rad]
    before: Array  # (M, 3) pull [m], lateral pull [m], sheath bend [rad] at control periods before the first
    between: Array  # (N, periods, 3) the same from the previous sample to this one; unused for the first

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
        if lateral_pull is not None and preset.bending_planes == 1:
            raise InputError(f"a lateral command: {preset.name!r} has one bending plane, it needs two")
        if lateral_pull is None:
            lateral_pull = np.full(len(pull), sum(preset.command_zeros[1:]))
        lateral_pull = np.asarray(lateral_pull, dtype=float)
        check_finite(lateral_pull)
        bend = np.asarray(preset.sheath_bend if sheath_bend is None else sheath_bend, dtype=float)
        bend = np.full(len(pull), bend) if bend.ndim == 0 else bend
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
    """Return the inputs (M, 3) from rest to the first sample; the shorter path waits at rest."""
    zeros = preset.command_zeros
    paths = [approach(start - zero, preset.control_period) for start, zero in zip(first, zeros, strict=False)]
    inputs = np.zeros((max(map(len, paths)), 3))
    for column, (path, zero) in enumerate(zip(paths, zeros, strict=True)):
        inputs[:, column] = zero
        inputs[len(inputs) - len(path) :, column] += path
    inputs[:, 2] = first[2]
    return inputs


def commands_of(
    presets: Sequence[Preset],
    pulls: Sequence[Array],
    sample_time: float,
    lateral_pulls: Sequence[Array | None] | None = None,
    sheath_bends: Sequence[Array | float | None] | None = None,
) -> list[Command]:
    """Check the signals of a batch and interpolate them to the control periods, as `Command.of`."""
    count = len(presets)
    laterals = [None] * count if lateral_pulls is None else lateral_pulls
    bends = [None] * count if sheath_bends is None else sheath_bends
    times = [sample_time] * count
    return [Command.of(*of_one) for of_one in zip(presets, pulls, times, laterals, bends, strict=True)]


def record_of(
    command: Command,
    *,
    bend: Array,
    joint_angle: Array,
    wire_tension: Array,
    sheath_friction: Array,
    wire_slack: Array,
    pulley: Array,
    metadata: dict[str, Any],
) -> Episode:
    """Return the record of a simulation of N samples.

    Bend (N, planes) [rad], joint angle (N, planes, vertebrae) [rad], wire tension (N, wires, elements + 1)
    [N], sheath friction (N, wires, elements) [N], wire slack (N, wires, elements + 1) [m], distance by which
    the pulley has pulled wire a (N,) [m], and what the metadata hold besides preset and version.
    """
    lateral: dict[str, Any] = {}
    if command.preset.bending_planes == 2:
        lateral = {"lateral_pull": command.lateral_pull}
        lateral |= {"lateral_bend": bend[:, 1], "lateral_joint_angle": joint_angle[:, 1]}
    return Episode(
        time=np.arange(len(bend), dtype=float) * command.sample_time,
        pull=command.pull,
        bend=bend[:, 0],
        measured_bend=bend[:, 0].copy(),
        joint_angle=joint_angle[:, 0],
        wire_tension=wire_tension,
        sheath_friction=sheath_friction,
        pulley=pulley,
        sheath_bend=command.sheath_bend,
        wire_slack=wire_slack,
        **lateral,
        metadata={"preset": command.preset.to_dict(), "endotwin": __version__} | metadata,
    )
