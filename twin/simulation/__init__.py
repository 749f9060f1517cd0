"""Interface of both twins: in MuJoCo, and the reduced one, which solves the same equations far faster."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError, needs_extra
from twin.preset.preset import Preset, at_sample_time

if TYPE_CHECKING:
    from twin.physics.endoscope import Endoscope
    from twin.physics.stepping import State
    from twin.reduced.parameters import ReducedState
    from twin.reduced.twins import ReducedEndoscope

Array = NDArray[np.float64]

PHYSICS = ("mujoco", "reduced")  # the first is the default


def check_physics(physics: str) -> None:
    """Refuse a name that is not one of `PHYSICS`."""
    if physics not in PHYSICS:
        raise InputError(f"unknown physics {physics!r:.40}; valid: {', '.join(PHYSICS)}")


def _twin(physics: str, function: str) -> Any:
    """Return a function of a twin; the error of a missing MuJoCo names the extra to install."""
    check_physics(physics)
    with needs_extra(f"twin.{function}"):
        if physics == "reduced":
            from twin import reduced as chosen
        else:
            from twin import physics as chosen  # type: ignore[no-redef]
    return getattr(chosen, function)


def simulate(
    preset: Preset,
    pull: Array,
    sample_time: float,
    *,
    physics: str = "mujoco",
    lateral_pull: Array | None = None,
    sheath_bend: Array | float | None = None,
    state: "State | ReducedState | None" = None,
    endoscope: "Endoscope | ReducedEndoscope | None" = None,
    on_sample: Callable[[Any], None] | None = None,
) -> Episode:
    """Simulate an endoscope along a command signal.

    Args:
        preset: the endoscope.
        pull: (N,) commanded pulling distance of wire a at each sample [m], linear in between.
        sample_time: time between two samples [s]; control periods become shorter where they do not divide it.
        physics: `mujoco`, or `reduced`: quasi-static, without MuJoCo and without gravity, far faster.
        lateral_pull: (N,) commanded pulling distance of wire c [m], with two bending planes; else zero.
        sheath_bend: (N,) angle of the sheath at each sample [rad], or one angle; without it, the preset's.
        state: of that twin's `save_state`, where the run begins. Without it the run begins straight and at
            rest, and goes to `pull[0]` along a real path that is not part of the record.
        endoscope: the instance to drive, where its state at the end is wanted; else a fresh one.
        on_sample: called with the endoscope at every sample, to read what the record does not hold.

    Returns:
        The record; `measured_bend` equals `bend`: the sensor comes after the physics (`signals/sensor.py`).

    Raises:
        ValueError: a signal, the sample time, the state or gravity does not fit the endoscope and its twin.
        FloatingPointError: the simulation diverged.
    """
    preset = preset if endoscope is not None else at_sample_time(preset, sample_time)
    record: Episode = _twin(physics, "simulate")(
        preset,
        pull,
        sample_time,
        lateral_pull=lateral_pull,
        sheath_bend=sheath_bend,
        state=state,
        endoscope=endoscope,
        on_sample=on_sample,
    )
    return record


def simulate_batch(
    presets: Sequence[Preset],
    pulls: Sequence[Array],
    sample_time: float,
    *,
    physics: str = "mujoco",
    sheath_bends: Sequence[Array | float | None] | None = None,
    lateral_pulls: Sequence[Array | None] | None = None,
    threads: int = 0,
    on_sample: Callable[[int, int], None] | None = None,
) -> list[Episode | None]:
    """Simulate B endoscopes at once, each along its own command; other arguments as in `simulate`.

    Args:
        presets: endoscopes with equal numbers of planes, vertebrae and elements and equal time steps.
        pulls: B commands; they may differ in length.
        sample_time: time between two samples [s], of all.
        physics: `mujoco` or `reduced`.
        sheath_bends: B bends of the sheath.
        lateral_pulls: B lateral commands.
        threads: number of threads; 0 for one per core.
        on_sample: called with the number of samples done and their total.

    Returns:
        B records; None in the place of an endoscope whose simulation diverged.
    """
    options: dict[str, Any] = {"sheath_bends": sheath_bends, "lateral_pulls": lateral_pulls}
    options |= {"threads": threads, "on_sample": on_sample}
    records: list[Episode | None] = _twin(physics, "simulate_batch")(presets, pulls, sample_time, **options)
    return records
