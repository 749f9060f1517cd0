"""Drive train between command and wires: delay, servo, encoder and gear backlash.

Three parts in a row: a pure delay, linear between control periods; a motor under a position loop with limits;
the play of a gear (Brokate and Sprekels 1996, 'Hysteresis and Phase Transitions', chapter 2: play operator).
The last two are exact over one control period.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.preset.preset import Preset

Array = NDArray[np.float64]
DriveState = tuple[float, float, float, float]  # motor, its stride (see `Drive`), pulley, command [m]
PULLEY_STIFFNESS = 4e6  # of the spring that holds a pulley where its drive is, far above a wire's [N / m]
SUDDEN = 0.01  # time in which a change of speed counts as sudden [s]
PARTS = 16  # of a control period, in each of which a motor that is late may change its speed
_LEAST_CHANGE = 1e-200  # of the velocity per control period [m]: a smaller one could underflow to zero


class DriveLaw(NamedTuple):
    """Constants of a drive, per control period."""

    share: float  # of the error that the position loop makes good [-]
    longest: float  # stride [m]
    change: float  # of the stride [m]
    sudden: float  # change of the stride, and stride, that a motor makes without taking note of the limit [m]
    encoder_step: float  # one count of the encoder [m]; 0 is continuous
    half_play: float  # of the gear [m]
    stiff: bool  # True if the motor follows without lag
    delay: float  # of the command, in control periods [-]


def drive_law(preset: Preset) -> DriveLaw:
    """Return the constants of a preset's drive."""
    period = preset.control_period
    gain, speed, acceleration = preset.servo_gain, preset.servo_speed, preset.servo_acceleration
    counts = preset.encoder_counts
    return DriveLaw(
        share=-math.expm1(-gain * period) if gain else 1.0,
        longest=speed * period if speed else math.inf,
        change=max(acceleration * period**2, _LEAST_CHANGE) if acceleration else math.inf,
        sudden=acceleration * period * max(period, SUDDEN) if acceleration else math.inf,
        encoder_step=2 * math.pi * preset.pulley_radius / counts if counts else 0.0,
        half_play=preset.backlash / 2,
        stiff=not (gain or speed or acceleration),
        delay=round(preset.command_delay / period, 9),
    )


def is_rigid(law: DriveLaw) -> bool:
    """Return True if the pulley follows the command exactly: no delay, servo, encoder or backlash."""
    return law.stiff and not law.encoder_step and not law.half_play and not law.delay


def delayed_command(delay: float, past: Sequence[float] | Array, command: float) -> float:
    """Return the command that a motor follows; `past` ones are those before, the last one first. A kernel."""
    whole = int(delay)
    part = delay - whole
    later = command if whole == 0 else past[whole - 1]
    return later if part == 0.0 else later + part * (past[whole] - later)


def advance_drive(
    law: DriveLaw, motor: float, stride: float, pulley: float, start: float, command: float
) -> DriveState:
    """Return the state of a drive one control period later, at a command for its end [m]; a kernel."""
    if law.stiff:
        motor = law.encoder_step * round(command / law.encoder_step) if law.encoder_step else command
    else:
        # A motor that its acceleration keeps from the command has a path of its own within the period. One
        # that follows a slow command is there, whatever the period.
        error = command - motor
        late = max(max(abs(error), abs(error - stride)), PARTS * abs(start - motor)) > law.sudden
        parts = PARTS if late and not law.encoder_step else 1
        change = law.change / (parts * parts) if late or law.encoder_step else math.inf
        longest, stride = law.longest / parts, stride / parts
        share = law.share if parts == 1 else 1.0 - (1.0 - law.share) ** (1.0 / parts)
        for part in range(1, parts + 1):
            wanted = command if part == parts else start + (command - start) * part / parts
            if law.encoder_step:
                counts = round(wanted / law.encoder_step) - round(motor / law.encoder_step)
                error = law.encoder_step * counts
                # The true travel is up to half a count shorter than the counted one. Stopping a quarter
                # before its end, the motor stays clear of the far edge of the count, where it would have to
                # turn back.
                reach = abs(error) - law.encoder_step / 4 if counts else 0.0
            else:
                error = wanted - motor
                reach = abs(error)

            size = min(min(share * abs(error), longest), reach)
            if change < math.inf:
                steps = max(1, math.ceil((math.sqrt(1 + 8 * reach / change) - 1) / 2))
                size = min(size, reach / steps + change * (steps - 1) / 2)
            before, stride = stride, math.copysign(size, error)
            stride = min(max(stride, before - change), before + change)

            # Arrived without an encoder: motor + (wanted - motor) may miss the command by its last digit.
            motor = wanted if stride == error and not law.encoder_step else motor + stride
        stride *= parts

    # The pulley rests until a flank of the gear pushes it: wires do not drive a worm gear back.
    if not law.half_play:
        pulley = motor
    elif pulley < motor - law.half_play:
        pulley = motor - law.half_play
    elif pulley > motor + law.half_play:
        pulley = motor + law.half_play
    return motor, stride, pulley, command


class Drive:
    """Drive train of one bending plane: motor, encoder, gear and pulley; positions are pulling distances [m].

    Motor and pulley are at 0 where the command is at `zero`.

    The motor moves by one *stride* s in each control period T, by the error e that its encoder counts. Where
    the acceleration limit keeps it from the command, T is a part of the control period: then its path hardly
    depends on that. The state has the stride at the last speed.

        s = e (1 - exp(-gain T))               position loop: de/dt = -gain e, exact over T
        |s| <= speed T                         speed limit
        |s| <= |e| / n + h (n - 1) / 2         stopping distance, with h = acceleration T^2
        |s - s_before| <= h                    acceleration limit

    Strides that shrink by h each cover s + (s - h) + ... = n s - h n (n - 1) / 2 in n = ceil(s / h) periods
    until they end. The third line is this with the sum |e|, and in the limit of short periods the usual
    speed <= sqrt(2 acceleration |e|). A motor that keeps to it arrives without overshoot, and stays. Without
    feedforward it is late by about v / gain, or v^2 / (2 acceleration), behind a command of the speed v.
    """

    def __init__(self, preset: Preset, zero: float = 0.0) -> None:
        """Set up the drive of a preset at rest; the endoscope is neutral at the command `zero` [m]."""
        self._law, self._zero = drive_law(preset), zero
        self.reset()

    def reset(self) -> None:
        """Reset motor and pulley to rest at 0, in the middle of the backlash."""
        self._state = (0.0, 0.0, 0.0, 0.0)
        self._past = (self._zero,) * math.ceil(self._law.delay)

    def state(self) -> tuple[float, ...]:
        """Return the complete state: `DriveState`, then the commands that a delay keeps, latest first."""
        return *self._state, *self._past

    def restore(self, state: tuple[float, ...]) -> None:
        """Restore a state that `state` returned; the run continues bit for bit."""
        motor, stride, pulley, command, *past = state
        self._state, self._past = (motor, stride, pulley, command), tuple(past)

    def advance(self, command: float) -> float:
        """Advance by one control period; return the distance that the pulley has pulled then [m]."""
        if not math.isfinite(command):
            raise InputError(f"commanded pulling distance {command}: must be a finite number")
        wanted = delayed_command(self._law.delay, self._past, command) - self._zero
        self._past = (command, *self._past[:-1]) if self._past else ()
        self._state = advance_drive(self._law, *self._state, wanted)
        return self._state[2]

    def follow(self, commands: Array) -> Array:
        """Advance along commands for the ends of control periods (P,); return the pulls there (P,) [m]."""
        law, (motor, stride, pulley, start) = self._law, self._state
        strides = np.diff(commands, prepend=motor)
        change = np.abs(np.diff(strides, prepend=stride)).max()
        limited = law.share < 1.0 or max(np.abs(strides).max(), change) > min(law.sudden, law.longest)
        plain = not (law.encoder_step or law.half_play or law.delay or self._zero)
        if limited or not plain or not motor == pulley == start:
            return np.array([self.advance(command) for command in commands.tolist()])
        last = float(commands[-1])
        self._state = (last, stride if law.stiff else float(strides[-1]), last, last)
        return commands
