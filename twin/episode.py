"""One episode as arrays: what was commanded, what was true, what a sensor saw. Time is the leading axis."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Episode:
    """N samples of one run of the twin (or of a measured log), in SI units.

    Wires are indexed a, b = 0, 1: pulling a positive distance pulls wire a and pays out wire b.
    """

    time: Array
    """(N,) seconds since the start of the record."""
    pull: Array
    """(N,) commanded pulling distance [m]."""
    bend: Array
    """(N,) true bending angle of the tip [rad]."""
    measured_bend: Array
    """(N,) bending angle as the sensor saw it [rad]."""
    joint_angle: Array
    """(N, vertebrae) angle of each hinge, base to tip [rad]."""
    wire_tension: Array
    """(N, 2, elements + 1) tension in each length of wire, pulley to tip [N]."""
    sheath_friction: Array
    """(N, 2, elements) largest friction force that each element of the sheath can exert [N]."""
    metadata: dict[str, Any] = dataclasses.field(default_factory=dict)
    """Parameters, seed, signal and versions: what made this record."""
    attachments: dict[str, bytes] = dataclasses.field(default_factory=dict)
    """Files kept with the record by name: the model and the configuration."""

    def __post_init__(self) -> None:
        """Refuse arrays that do not belong together.

        Raises:
            ValueError: lengths differ, a value is not finite, or time does not increase.
        """
        count = len(self.time)
        for field in ("pull", "bend", "measured_bend", "joint_angle", "wire_tension", "sheath_friction"):
            values = getattr(self, field)
            if len(values) != count:
                raise ValueError(f"{field} has {len(values)} samples, time has {count}")
            if not np.isfinite(values).all():
                index = int(np.argwhere(~np.isfinite(values))[0][0])
                raise ValueError(f"{field} is not finite at sample {index}")
        if count < 2:
            raise ValueError(f"a record needs at least 2 samples, got {count}")
        if not np.isfinite(self.time).all() or not (np.diff(self.time) > 0).all():
            raise ValueError("time must increase from sample to sample")

    @property
    def sample_time(self) -> float:
        """Median time between two samples [s]."""
        return float(np.median(np.diff(self.time)))

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
        """(N,) measured bending angle in degrees."""
        return np.degrees(self.measured_bend)

    @property
    def tension(self) -> Array:
        """(N, 2) tension of the wires at the pulley, where a load cell would sit [N]."""
        return self.wire_tension[:, :, 0]

    def every(self, sample_time: float) -> "Episode":
        """Return the record thinned to a longer sample time.

        Raises:
            ValueError: `sample_time` is not a whole multiple of the record's own.
        """
        ratio = sample_time / self.sample_time
        step = round(ratio) if np.isfinite(ratio) else 0
        if step < 1 or abs(ratio - step) > 1e-6 * ratio:
            raise ValueError(
                f"sample time {sample_time:g} s: "
                f"must be a whole multiple of the record's {self.sample_time:g} s"
            )
        arrays = {
            field.name: getattr(self, field.name)[::step]
            for field in dataclasses.fields(self)
            if field.name not in ("metadata", "attachments")
        }
        return dataclasses.replace(self, **arrays)
