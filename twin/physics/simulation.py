"""Driving the endoscope by a command signal: arrays in, an `Episode` out."""

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode
from twin.excitation import approach, check_finite
from twin.physics.endoscope import Endoscope, State
from twin.preset import Preset

Array = NDArray[np.float64]


def simulate(
    preset: Preset,
    pull: Array,
    sample_time: float,
    *,
    state: State | None = None,
    endoscope: Endoscope | None = None,
    on_sample: Callable[[Endoscope], None] | None = None,
) -> Episode:
    """Run the twin along a command signal.

    Args:
        preset: the endoscope.
        pull: (N,) commanded pulling distance at each sample [m], linear in between.
        sample_time: time between two samples [s]; a whole multiple of `preset.control_period`.
        state: where the run begins. Without it the run begins straight and at rest, and goes to `pull[0]`
            along a real path that is not part of the record.
        endoscope: the instance to drive, where its state at the end is wanted; else a fresh one.
        on_sample: called with the endoscope at every sample, to read what the record does not hold.

    Returns:
        The record; `measured_bend` equals `bend`, as no sensor is part of the physics.

    Raises:
        ValueError: the command is not finite, or the sample time does not fit the control period.
        FloatingPointError: the simulation diverged.
    """
    pull = np.asarray(pull, dtype=float)
    check_finite(pull)
    periods = check_sample_time(preset, sample_time)
    endoscope = endoscope or Endoscope.from_preset(preset)
    if state is not None:
        endoscope.restore_state(state)
    else:
        for target in approach(pull[0], preset.control_period):
            endoscope.advance(target)

    count, elements = len(pull), preset.sheath_elements
    bend = np.empty(count)
    joint_angle = np.empty((count, preset.vertebrae))
    wire_tension = np.empty((count, 2, elements + 1))
    sheath_friction = np.empty((count, 2, elements))
    for k in range(count):
        if k > 0:
            for target in np.linspace(pull[k - 1], pull[k], periods + 1)[1:]:
                endoscope.advance(target)
        bend[k] = endoscope.bend()
        joint_angle[k] = endoscope.joint_angle()
        wire_tension[k] = endoscope.wire_tension()
        sheath_friction[k] = endoscope.sheath_friction()
        if on_sample is not None:
            on_sample(endoscope)

    return Episode(
        time=np.arange(count, dtype=float) * sample_time,
        pull=pull,
        bend=bend,
        measured_bend=bend.copy(),
        joint_angle=joint_angle,
        wire_tension=wire_tension,
        sheath_friction=sheath_friction,
        metadata={
            "preset": preset.to_dict(),
            "endotwin": __version__,
            "mujoco": mujoco.__version__,
        },
        attachments={"endoscope.xml": endoscope.xml.encode()},
    )


def check_sample_time(preset: Preset, sample_time: float) -> int:
    """Return how many control periods there are between two samples.

    Raises:
        ValueError: not a whole number.
    """
    periods = round(sample_time / preset.control_period) if np.isfinite(sample_time) else 0
    if periods < 1 or abs(periods * preset.control_period - sample_time) > 1e-9:
        raise ValueError(
            f"sample time {sample_time:g} s: must be a whole multiple of the control period, "
            f"{preset.control_period:g} s"
        )
    return periods
