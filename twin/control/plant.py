"""The plant: an endoscope in MuJoCo, or a reduced one, that is driven by one command after the other."""

from typing import Any

import numpy as np

from twin.errors import InputError
from twin.preset.preset import Preset, check_sample_time
from twin.simulation import check_physics, simulate


class Plant:
    """One endoscope, stepped from sample to sample along straight lines between commands.

    A run of `twin.simulate` along the same commands is the same, bit for bit.

    Attributes:
        preset: its parameters.
        endoscope: the simulated one.
        pull_mm: latest command [mm].
        sheath_bend: latest bend of the sheath [rad].
    """

    def __init__(self, preset: Preset, sample_time: float, physics: str = "mujoco") -> None:
        """Build the endoscope."""
        if preset.bending_planes != 1:
            raise InputError(f"{preset.name!r} has two bending planes: control is of one")
        check_physics(physics)
        self.preset, self._sample_time, self._physics = preset, sample_time, physics
        self._periods = check_sample_time(preset, sample_time)
        self.endoscope: Any
        if physics == "reduced":
            from twin.reduced.twins import ReducedEndoscope

            self.endoscope = ReducedEndoscope(preset, sample_time)
            self._periods = 1  # it is in equilibrium at samples alone, and finds its way between them itself
        else:
            from twin.physics import Endoscope

            self.endoscope = Endoscope.from_preset(preset, drawn=False)
        self.pull_mm, self.sheath_bend = preset.command_zero * 1e3, preset.sheath_bend

    def start(self, pull_mm: float) -> float:
        """Go from rest to a pull [mm], as the records of `simulate` begin; returns the bend [deg]."""
        self.endoscope.reset()
        self.pull_mm, self.sheath_bend = pull_mm, self.preset.sheath_bend
        at_samples: list[Any] = []
        simulate(
            self.preset,
            np.full(2, pull_mm * 1e-3),  # a record is no shorter
            self._sample_time,
            physics=self._physics,
            endoscope=self.endoscope,
            on_sample=lambda endoscope: at_samples.append(endoscope.save_state()),
        )
        self.endoscope.restore_state(at_samples[0])
        return self.bend_deg()

    def step(self, pull_mm: float, sheath_bend: float | None = None, tip_force: float = 0.0) -> float:
        """Go to the next command in one sample; returns the bend [deg].

        Args:
            pull_mm: command [mm].
            sheath_bend: bend of the sheath then, as before where not given [rad].
            tip_force: pushes the tip sideways meanwhile, in MuJoCo alone [N].
        """
        bend = self.sheath_bend if sheath_bend is None else sheath_bend
        before, now = self.pull_mm * 1e-3, pull_mm * 1e-3
        self._push(tip_force)
        for period in range(1, self._periods):
            share = period / self._periods
            self.endoscope.advance(
                before * (1 - share) + now * share, 0.0, self.sheath_bend * (1 - share) + bend * share
            )
        self.endoscope.advance(now, 0.0, bend)
        self.pull_mm, self.sheath_bend = pull_mm, bend
        return self.bend_deg()

    def _push(self, tip_force: float) -> None:
        if self._physics == "mujoco":
            self.endoscope.push_tip(tip_force)
        elif tip_force:
            raise InputError(f"force of {tip_force:g} N at the tip: needs MuJoCo, not {self._physics!r}")

    def bend_deg(self) -> float:
        """Return the bending angle [deg]."""
        return float(np.degrees(self.endoscope.bend()))

    def save_state(self) -> tuple[Any, float, float]:
        """Return the complete state."""
        return self.endoscope.save_state(), self.pull_mm, self.sheath_bend

    def restore_state(self, state: tuple[Any, float, float]) -> None:
        """Restore a state of `save_state`; the run continues bit for bit."""
        endoscope, self.pull_mm, self.sheath_bend = state
        self.endoscope.restore_state(endoscope)
