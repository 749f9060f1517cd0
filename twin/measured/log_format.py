"""Form of a measured log: which columns of its CSV file mean what, and in which units."""

import dataclasses

from twin.errors import InputError
from twin.measured.units import SECONDS_PER_CYCLE, TIME_COLUMNS, check_cycle

SHEATH_BEND_COLUMN = "sheath_bend_deg"
"""Name of the column of the angle that the sheath is bent by."""

LARGEST_RADIUS = 1.0
"""Largest radius of a pulley [m]."""
LARGEST_SHEATH_BEND_DEG = 1440.0
"""Largest bend of a sheath [deg], the limit of a preset."""


@dataclasses.dataclass(frozen=True)
class LogFormat:
    """Columns and units of a measured log; a unit of None is the ending of the column's name.

    Attributes:
        command_column: column of the command.
        command_unit: deg or rad for a pulley angle, mm or m for a pulling distance; of both commands.
        pulley_radius: radius that converts a pulley angle to a pulling distance [m].
        angle_column: column of the measured bending angle.
        angle_unit: deg or rad; of both angles.
        reverse_angle: True if the sensor counts a bend towards wire a as negative.
        lateral_command_column: column of the command of wires c and d; None: a log of one bending plane.
        lateral_angle_column: column of the measured angle in their plane.
        reverse_lateral_angle: True if the sensor counts a bend towards wire c as negative.
        time_column: column of the time or phase; None: time_s or phase_rad, whichever exists.
        time_unit: s, ms or us; rad for a phase.
        seconds_per_cycle: duration of a phase of 2 pi [s].
        tension_a_column: column of the tension of wire a at the pulley [N]; None: tension_a_n, if both
            tension_a_n and tension_b_n exist.
        tension_b_column: the same for wire b.
        sheath_bend_deg: bend angle of the sheath [deg]; None: the column of that name, if it exists.
    """

    command_column: str = "command_deg"
    command_unit: str | None = None
    pulley_radius: float = 0.01
    angle_column: str = "angle_deg"
    angle_unit: str | None = None
    reverse_angle: bool = False
    lateral_command_column: str | None = None
    lateral_angle_column: str | None = None
    reverse_lateral_angle: bool = False
    time_column: str | None = None
    time_unit: str | None = None
    seconds_per_cycle: float = SECONDS_PER_CYCLE
    tension_a_column: str | None = None
    tension_b_column: str | None = None
    sheath_bend_deg: float | None = None

    @property
    def columns(self) -> set[str]:
        """Names of all columns that such a log may have."""
        names = {self.command_column, self.angle_column, SHEATH_BEND_COLUMN}
        names |= {self.time_column} if self.time_column else {*TIME_COLUMNS}
        names |= {name for name in (self.lateral_command_column, self.lateral_angle_column) if name}
        return names | {self.tension_a_column or "tension_a_n", self.tension_b_column or "tension_b_n"}

    def check(self) -> None:
        """Refuse numbers that cannot be, and half a bending plane.

        Raises:
            ValueError: a number is out of range, or the columns do not make one plane or two.
        """
        if not 0 < self.pulley_radius <= LARGEST_RADIUS:
            raise InputError(
                f"`pulley_radius` is {self.pulley_radius:g} m: must be positive, at most {LARGEST_RADIUS:g} m"
            )
        check_cycle(self.seconds_per_cycle)
        bend = self.sheath_bend_deg
        if bend is not None and not 0 <= bend <= LARGEST_SHEATH_BEND_DEG:
            raise InputError(f"sheath_bend_deg = {bend:g}: must be from 0 to {LARGEST_SHEATH_BEND_DEG:g}")
        self._check_planes()

    def _check_planes(self) -> None:
        lateral = (self.lateral_command_column, self.lateral_angle_column)
        if lateral == (None, None):
            if self.reverse_lateral_angle:
                raise InputError(
                    "`reverse_lateral_angle` turns an angle: name its `lateral_angle_column` too"
                )
            return
        if None in lateral:
            raise InputError("give `lateral_command_column` and `lateral_angle_column` both, or neither")
        columns = (self.command_column, self.angle_column, *lateral)
        for name in columns:
            if columns.count(name) > 1:
                raise InputError(
                    f"column {name} is named twice: commands and angles are columns of their own"
                )
