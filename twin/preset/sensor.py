"""Sensor of the bending angle: what it reads, as preset files, trained files and flags state it."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.shown import shown, suggestion
from twin.preset.preset import ZERO_DEVIATION_DEG, Preset

Array = NDArray[np.float64]
AnyFloat = TypeVar("AnyFloat", float, Array)
KEY = "sensor"  # of preset files and trained files
LIMITS = {
    "variance_deg2": (0.0, 1e6),
    "zero_deg": (-180.0, 180.0),
    "zero_deviation_deg": (0.0, 180.0),
    "scale": (0.1, 10.0),
    "lag_s": (0.0, 10.0),
    "rate_hz": (0.0, 1e6),
}


@dataclasses.dataclass(frozen=True)
class SensorModel:
    """A sensor that reads scale * angle(t - lag) + zero + noise."""

    variance_deg2: float = 0.0  # R of the noise [deg^2]; 0: not known
    zero_deg: float = 0.0  # reading where the section is straight [deg]
    # standard deviation of what is known of the zero [deg]; 0: calibrated
    zero_deviation_deg: float = ZERO_DEVIATION_DEG
    scale: float = 1.0  # reading per angle [-]
    lag_s: float = 0.0  # age of a reading when it arrives [s]
    rate_hz: float = 0.0  # readings per second; 0: one for each sample

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and low <= value <= high):
                raise InputError(f"sensor {name} = {shown(value)}: must be from {low:g} to {high:g}")
            object.__setattr__(self, name, float(value))

    def angle_deg(self, reading_deg: AnyFloat) -> AnyFloat:
        """Return the angle that a reading states [deg]; the one `lag_s` ago. NaN stays."""
        return (reading_deg - self.zero_deg) / self.scale

    @property
    def is_plain(self) -> bool:
        """Whether a reading is the angle as it stands, but for its noise."""
        return self.zero_deg == 0 and self.scale == 1 and self.lag_s == 0

    def angles_deg(self, time: Array, reading_deg: Array) -> Array:
        """Return the angles at times (N,) [s], linear between those that readings (N,) state [deg].

        NaN where a reading is missing, and within `lag_s` of the end.
        """
        angle = self.angle_deg(reading_deg)
        return np.interp(time + self.lag_s, time, angle, right=np.nan) if self.lag_s else angle

    def replace(self, **values: float | None) -> Self:
        """Return a copy with the values that are given, which are not None."""
        return dataclasses.replace(self, **{name: of for name, of in values.items() if of is not None})

    @classmethod
    def of(cls, preset: Preset) -> Self:
        """Return the sensor of a preset."""
        return cls(
            variance_deg2=math.degrees(preset.sensor_noise) ** 2,
            zero_deg=math.degrees(preset.sensor_zero),
            zero_deviation_deg=math.degrees(preset.sensor_zero_deviation),
            scale=preset.sensor_scale,
            lag_s=preset.sensor_latency,
            rate_hz=1 / preset.sensor_period if preset.sensor_period else 0.0,
        )

    @classmethod
    def from_dict(cls, values: Any) -> Self:
        """Return the sensor from values by name, as files contain them; what is left out is the default."""
        if not isinstance(values, Mapping):
            raise InputError(f"{KEY} = {shown(values)}: must be `name: value` lines")
        for name in values:
            if name not in LIMITS:
                raise InputError(
                    f"unknown sensor parameter {shown(name)}{suggestion(str(name), list(LIMITS))}"
                )
        return cls(**values)

    def to_dict(self) -> dict[str, float]:
        """Return the values by name."""
        return dataclasses.asdict(self)

    def parameters(self) -> dict[str, float]:
        """Return the parameters of a preset with this sensor, in SI units."""
        return {
            "sensor_noise": math.radians(math.sqrt(self.variance_deg2)),
            "sensor_zero": math.radians(self.zero_deg),
            "sensor_zero_deviation": math.radians(self.zero_deviation_deg),
            "sensor_scale": self.scale,
            "sensor_latency": self.lag_s,
            "sensor_period": 1 / self.rate_hz if self.rate_hz else 0.0,
        }
