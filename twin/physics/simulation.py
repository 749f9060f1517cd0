"""Simulation of one endoscope along a command signal: arrays in, an `Episode` out."""

import dataclasses
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.mechanics.command import Command, record_of
from twin.physics.endoscope import Endoscope, State
from twin.physics.layout import Layout
from twin.physics.load import Wires
from twin.preset.preset import Preset

Array = NDArray[np.float64]

MUJOCO = mujoco.__version__  # version of MuJoCo that simulates


def simulate(
    preset: Preset,
    pull: Array,
    sample_time: float,
    *,
    lateral_pull: Array | None = None,
    sheath_bend: Array | float | None = None,
    state: State | None = None,
    endoscope: Endoscope | None = None,
    on_sample: Callable[[Endoscope], None] | None = None,
) -> Episode:
    """Simulate an endoscope along a command signal; see `twin.simulate`."""
    command = Command.of(preset, pull, sample_time, lateral_pull, sheath_bend)
    # No caller can draw it, so it is built without shapes.
    endoscope = endoscope or Endoscope.from_preset(preset, drawn=on_sample is not None)
    if state is not None:
        endoscope.restore_state(state)
    else:
        for inputs in command.before.tolist():
            endoscope.advance(*inputs)
    record = Recorder(command, endoscope.layout)
    qpos, friction = endoscope.data.ptr.qpos, endoscope.sheath_friction
    for k, periods in enumerate(command.between.tolist()):
        for inputs in periods if k > 0 else ():
            endoscope.advance(*inputs)
        record.add(k, qpos, friction())
        if on_sample is not None:
            on_sample(endoscope)
    return record.episode(endoscope.xml)


class Recorder:
    """Recorder of a simulation: collects the readings of every sample into an `Episode`."""

    def __init__(self, command: Command, layout: Layout) -> None:
        count = len(command.pull)
        self._command, self._layout = command, layout
        self._qpos = np.empty((count, layout.hinge.size + layout.pulley.size + layout.element.size))
        self._sheath_friction = np.empty((count, *layout.element.shape))

    def add(self, sample: int, qpos: Array, sheath_friction: Array) -> None:
        """Store a sample: positions (nq,), friction (wires, elements); tension and slack follow from them."""
        self._qpos[sample] = qpos
        self._sheath_friction[sample] = sheath_friction

    def episode(self, xml: str) -> Episode:
        """Return the recorded episode, with the MJCF model attached."""
        # Contiguous, so that sums round as `Endoscope.bend` does.
        joint_angle = np.ascontiguousarray(self._qpos[:, self._layout.hinge])
        tension, slack = Wires([self._command.preset], self._layout).tension_and_slack(self._qpos)
        record = record_of(
            self._command,
            bend=joint_angle.sum(axis=2),
            joint_angle=joint_angle,
            wire_tension=tension,
            sheath_friction=self._sheath_friction,
            wire_slack=slack,
            pulley=self._qpos[:, self._layout.pulley[0]],
            metadata={"mujoco": MUJOCO},
        )
        return dataclasses.replace(record, attachments={"endoscope.xml": xml.encode()})
