"""Drive train between command and wires: servo, encoder and gear backlash.

Two parts in a row, each exact over one control period: a motor under a position loop with limits, then the
play of a gear (Brokate and Sprekels 1996, 'Hysteresis and Phase Transitions', chapter 2: play operator).
"""

import math

from twin.errors import InputError
from twin.preset.preset import Preset

DriveState = tuple[float, float, float]
"""Position of the motor, its distance in the last control period, position of the pulley [m]."""

_LEAST_CHANGE = 1e-200
"""Smallest allowed change of velocity per control period [m]: a smaller one could underflow to zero."""


class Drive:
    """Drive train of one bending plane: motor, encoder, gear and pulley; positions are pulling distances [m].

    The motor moves by one *stride* s in each control period T, by the error e that its encoder counts:

        s = e (1 - exp(-gain T))               position loop: de/dt = -gain e, exact over T
        |s| <= speed T                         speed limit
        |s| <= |e| / n + h (n - 1) / 2         stopping distance, with h = acceleration T^2
        |s - s_before| <= h                    acceleration limit

    Strides that shrink by h each cover s + (s - h) + ... = n s - h n (n - 1) / 2 in n = ceil(s / h) periods
    until they end. The third line is this with the sum |e|, and in the limit of short periods the usual
    speed <= sqrt(2 acceleration |e|). A motor that keeps to it arrives without overshoot, and stays.

    There is no feedforward: behind a command that moves with the speed v the motor is late by about v / gain,
    or by v^2 / (2 acceleration) where that is more.
    """

    def __init__(self, preset: Preset) -> None:
        """Set up the drive of a preset, in the state that `reset` leaves."""
        period = preset.control_period
        gain, speed, acceleration = preset.servo_gain, preset.servo_speed, preset.servo_acceleration
        self._share = -math.expm1(-gain * period) if gain else 1.0
        self._longest = speed * period if speed else math.inf
        self._change = max(acceleration * period**2, _LEAST_CHANGE) if acceleration else math.inf
        self._stiff = not (gain or speed or acceleration)
        counts = preset.encoder_counts
        self._count = 2 * math.pi * preset.pulley_radius / counts if counts else 0.0
        self._half_play = preset.backlash / 2
        self.reset()

    @property
    def rigid(self) -> bool:
        """True if the pulley follows the command exactly: no servo, no encoder, no backlash."""
        return self._stiff and not self._count and not self._half_play

    def reset(self) -> None:
        """Reset motor and pulley to rest at 0, in the middle of the backlash."""
        self._motor = self._stride = self._pulley = 0.0

    def state(self) -> DriveState:
        """Return the complete state of the drive."""
        return self._motor, self._stride, self._pulley

    def restore(self, state: DriveState) -> None:
        """Restore a state that `state` returned; the run continues bit for bit."""
        self._motor, self._stride, self._pulley = state

    def advance(self, command: float) -> float:
        """Advance the drive by one control period.

        Args:
            command: pulling distance that is asked for at the end of the period [m].

        Returns:
            Distance that the pulley has really pulled by then [m]: the command itself, bit for bit, where the
            preset has no servo, no encoder and no backlash.

        Raises:
            ValueError: the command is not finite.
        """
        if not math.isfinite(command):
            raise InputError(f"commanded pulling distance {command}: must be a finite number")
        if not self._stiff:
            self._turn_motor(command)
        elif self._count:
            self._motor = self._count * round(command / self._count)
        else:
            self._motor = command

        # The pulley rests until a flank of the gear pushes it: wires do not drive a worm gear back.
        if not self._half_play:
            self._pulley = self._motor
        elif self._pulley < self._motor - self._half_play:
            self._pulley = self._motor - self._half_play
        elif self._pulley > self._motor + self._half_play:
            self._pulley = self._motor + self._half_play
        return self._pulley

    def _turn_motor(self, command: float) -> None:
        """Move the motor by one stride."""
        if self._count:
            counts = round(command / self._count) - round(self._motor / self._count)
            error = self._count * counts
            # The true way is up to half a count shorter than the counted one. Stopping a quarter before its
            # end, the motor stays clear of the far edge of the count, where it would have to turn back.
            reach = abs(error) - self._count / 4 if counts else 0.0
        else:
            error = command - self._motor
            reach = abs(error)

        size = min(self._share * abs(error), self._longest, reach)
        if self._change < math.inf:
            periods = max(1, math.ceil((math.sqrt(1 + 8 * reach / self._change) - 1) / 2))
            size = min(size, reach / periods + self._change * (periods - 1) / 2)
        stride = math.copysign(size, error)
        stride = min(max(stride, self._stride - self._change), self._stride + self._change)

        # Arrived without an encoder: motor + (command - motor) may miss the command by its last digit.
        self._motor = command if stride == error and not self._count else self._motor + stride
        self._stride = stride
