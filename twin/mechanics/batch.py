"""Batch of endoscopes: their commands, and what they must have in common."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.mechanics.command import Command
from twin.preset.preset import Preset

Array = NDArray[np.float64]

ALIKE = ("bending_planes", "vertebrae", "sheath_elements", "control_period")
"""Parameters that the endoscopes of a batch share: they set the shapes of its arrays, or its clock."""


def check_alike(presets: Sequence[Preset], names: Sequence[str] = ALIKE) -> None:
    """Refuse a batch of no endoscopes, or of such as differ in what they must share.

    Raises:
        ValueError: it is one.
    """
    if not presets:
        raise InputError("a batch needs at least one endoscope")
    for name in names:
        if len({getattr(preset, name) for preset in presets}) > 1:
            raise InputError(f"the endoscopes of a batch must agree in {name}")


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
