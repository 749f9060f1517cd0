"""One episode as arrays: what was commanded, what was true, what a sensor saw. Time is the leading axis."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]

LARGEST_GRID = 10_000_000
"""Samples of an even grid: more come of a wrong time stamp, and would fill the memory."""

WIRES = "abcd"
"""Names of the wires, by index: a against b in the first bending plane, c against d sideways."""

OPTIONAL = ("pulley", "sheath_bend", "wire_slack", "lateral_pull", "lateral_bend", "lateral_joint_angle")
"""Fields of an episode that may be empty: not recorded, or not there in one bending plane."""


def _not_recorded() -> Array:
    return np.empty(0)


@dataclasses.dataclass(frozen=True)
class Episode:
    """N samples of one run of the twin (or of a measured log), in SI units.

    Wires are indexed a, b (, c, d) = 0, 1 (, 2, 3): pulling a positive distance pulls wire a and pays out
    wire b, pulling a positive lateral distance pulls wire c and pays out wire d. A field that may be empty is
    so where it was not recorded.

    Attributes:
        time: (N,) seconds since the start of the record.
        pull: (N,) commanded pulling distance [m].
        bend: (N,) true bending angle of the tip, in the plane of wires a and b [rad].
        measured_bend: (N,) bending angle as the sensor saw it [rad]; NaN where it is missing, the only field
            that may be.
        joint_angle: (N, vertebrae) angle of each hinge, base to tip [rad].
        wire_tension: (N, wires, elements + 1) tension in each length of wire, pulley to tip [N].
        sheath_friction: (N, wires, elements) largest friction force that each element of the sheath can
            exert [N].
        pulley: (N,) distance that the pulley has really pulled, behind servo and backlash [m]; may be empty.
        sheath_bend: (N,) angle that the sheath is bent by [rad]; may be empty.
        wire_slack: (N, wires, elements + 1) how much longer each length of wire is than its way [m], pulley
            to tip; zero where it is taut; may be empty.
        lateral_pull: (N,) commanded pulling distance of wire c against d [m]; empty with one bending plane.
        lateral_bend: (N,) true bending angle of the tip, in the plane of wires c and d [rad]; empty with one
            bending plane.
        lateral_joint_angle: (N, vertebrae) angle of each sideways hinge, base to tip [rad]; empty with one
            bending plane.
        metadata: parameters, seed, signal and versions: what made this record.
        attachments: files kept with the record by name: the model and the configuration.
    """

    time: Array
    pull: Array
    bend: Array
    measured_bend: Array
    joint_angle: Array
    wire_tension: Array
    sheath_friction: Array
    pulley: Array = dataclasses.field(default_factory=_not_recorded)
    sheath_bend: Array = dataclasses.field(default_factory=_not_recorded)
    wire_slack: Array = dataclasses.field(default_factory=_not_recorded)
    lateral_pull: Array = dataclasses.field(default_factory=_not_recorded)
    lateral_bend: Array = dataclasses.field(default_factory=_not_recorded)
    lateral_joint_angle: Array = dataclasses.field(default_factory=_not_recorded)
    metadata: dict[str, Any] = dataclasses.field(default_factory=dict)
    attachments: dict[str, bytes] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse arrays that do not belong together.

        Raises:
            ValueError: lengths differ, a value is not finite (a measurement may be NaN), or time does not
                increase.
        """
        count = len(self.time)
        for field in [field.name for field in dataclasses.fields(self)[1:]]:
            values = getattr(self, field)
            if field in ("metadata", "attachments") or (field in OPTIONAL and len(values) == 0):
                continue
            if len(values) != count:
                raise InputError(f"{field} has {len(values)} samples, time has {count}")
            wrong = np.isinf(values) if field == "measured_bend" else ~np.isfinite(values)
            if wrong.any():
                raise InputError(f"{field} is not finite at sample {int(np.argwhere(wrong)[0][0])}")
        if count < 2:
            raise InputError(f"a record needs at least 2 samples, got {count}")
        if not np.isfinite(self.time).all() or not (np.diff(self.time) > 0).all():
            raise InputError("time must increase from sample to sample")

    def __repr__(self) -> str:
        """Three lines: what made the record, its samples and ranges, and what is recorded."""
        missing = int(np.isnan(self.measured_bend).sum())
        recorded = [
            name + (f" ({missing} missing)" if name == "measured_bend" and missing else "")
            for name, values in self._arrays().items()
            if values.size and name not in ("time", "pull", "bend")
        ]
        seconds = float(self.time[-1] - self.time[0])
        pull, bend = self.pull_mm, self.bend_deg
        return (
            f"Episode {self._origin()}\n"
            f"  {len(self.time)} samples every {self.sample_time:g} s, {seconds:g} s; "
            f"pull {pull.min():.2f} to {pull.max():.2f} mm, bend {bend.min():.1f} to {bend.max():.1f} deg\n"
            f"  recorded: time, pull, bend, {', '.join(recorded)}"
        )

    @property
    def sample_time(self) -> float:
        """Median time between two samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def is_measured(self) -> bool:
        """True where a real endoscope left this record, not the twin."""
        return bool(self.metadata.get("source") == "measured")

    @property
    def pull_mm(self) -> Array:
        """(N,) commanded pulling distance in millimetres, the unit of the Coleman-Hodgdon parameters."""
        return self.pull * 1e3

    @property
    def bend_deg(self) -> Array:
        """(N,) true bending angle in degrees."""
        return np.degrees(self.bend)

    @property
    def measured_bend_deg(self) -> Array:
        """(N,) measured bending angle in degrees, NaN where it is missing."""
        return np.degrees(self.measured_bend)

    @property
    def tension(self) -> Array:
        """(N, wires) tension of the wires at the pulley, where a load cell would sit [N]."""
        return self.wire_tension[:, :, 0]

    def every(self, sample_time: float) -> "Episode":
        """Return the record thinned to a longer sample time.

        Raises:
            ValueError: `sample_time` is not a whole multiple of the record's own.
        """
        ratio = sample_time / self.sample_time
        step = round(ratio) if np.isfinite(ratio) else 0
        if step < 1 or abs(ratio - step) > 1e-6 * ratio:
            raise InputError(
                f"`sample_time` {sample_time:g} s: "
                f"must be a whole multiple of the record's {self.sample_time:g} s"
            )
        return dataclasses.replace(self, **{name: values[::step] for name, values in self._arrays().items()})

    def on_grid(self, sample_time: float) -> "Episode":
        """Return the record at even samples, linear between its own: for a log that has none.

        A sample of the grid lies in a gap where the measurements before and after it are two sample times or
        more apart (of the grid or of the record, whichever is longer), unless it is at one of them. Its
        `measured_bend` is NaN; everything else is linear there too.

        Raises:
            ValueError: `sample_time` is not positive, or the record is shorter than two samples or longer
                than `LARGEST_GRID`.
        """
        if not 0 < sample_time < np.inf:
            raise InputError(f"sample time {sample_time:g} s: must be positive")
        seconds = float(self.time[-1] - self.time[0])
        if seconds / sample_time > LARGEST_GRID:
            raise InputError(
                f"sample time {sample_time:g} s: a record of {seconds:g} s would be more than "
                f"{LARGEST_GRID} samples: choose a longer one, or check the record's time"
            )
        grid = np.arange(self.time[0], self.time[-1] + 1e-9, sample_time)

        def even(values: Array) -> Array:
            if len(values) == 0:
                return values
            shape = (len(grid), *values.shape[1:])
            columns = values.reshape(len(values), int(np.prod(values.shape[1:])))
            return np.array([np.interp(grid, self.time, column) for column in columns.T]).T.reshape(shape)

        arrays = {name: even(values) for name, values in self._arrays().items() if name != "measured_bend"}
        measured = self._measured_on(grid, max(sample_time, self.sample_time))
        return dataclasses.replace(self, **(arrays | {"time": grid - grid[0], "measured_bend": measured}))

    def _measured_on(self, grid: Array, reach: float) -> Array:
        """(M,) measured angle on a grid, NaN between measurements that are twice `reach` or more apart."""
        known = ~np.isnan(self.measured_bend)
        if not known.any():
            return np.full(len(grid), np.nan)
        time = self.time[known]
        place = np.searchsorted(time, grid)
        before, after = np.append(-np.inf, time)[place], np.append(time, np.inf)[place]
        rounding = 1e-6 * reach
        seen = after - before < 2 * (reach - rounding)
        seen |= np.minimum(grid - before, after - grid) <= rounding
        return np.where(seen, np.interp(grid, time, self.measured_bend[known]), np.nan)

    def _origin(self) -> str:
        """Maker of the record, as far as its metadata tells."""
        facts = self.metadata
        preset = facts.get("preset")
        preset = preset.get("name") if isinstance(preset, dict) else preset
        told = [f"{facts['name']!r}"] if facts.get("name") else []
        told += ["measured"] if self.is_measured else [f"of {preset}"] if preset else []
        told += [f"{name} {facts[name]}" for name in ("signal", "seed", "episode") if name in facts]
        return ", ".join(told) or "of unknown origin"

    def _arrays(self) -> dict[str, Any]:
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name not in ("metadata", "attachments")
        }


def without_holes(time: Array, angle: Array) -> Array:
    """Return a measured angle (N,) with each NaN linear between its neighbours, level at the ends.

    Raises:
        ValueError: it is NaN throughout.
    """
    known = ~np.isnan(angle)
    if not known.any():
        raise InputError("no angle is measured: a measured record needs one")
    return np.where(known, angle, np.interp(time, time[known], angle[known]))
