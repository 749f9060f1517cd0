"""Entry of `benchmark.json`: a measured figure, beside that of a peer where there is one."""

import dataclasses
import os
import platform
from typing import Any


@dataclasses.dataclass(frozen=True)
class Result:
    """Measured figure of a benchmark.

    Attributes:
        name: name of the figure.
        value: measured value, in `unit`.
        unit: unit of both values.
        bar: required bound, in words; empty where nothing is promised.
        holds: True if the bound holds.
        peer: reference measured in the same run; None without one.
        peer_value: measured value of the reference, in `unit`.
    """

    name: str
    value: float
    unit: str
    bar: str
    holds: bool = True
    peer: str | None = None
    peer_value: float | None = None

    @property
    def ratio(self) -> float | None:
        """Value divided by that of the peer; None without one."""
        return None if not self.peer_value else self.value / self.peer_value

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as `benchmark.json` holds it."""
        return {
            "value": self.value,
            "unit": self.unit,
            "peer": self.peer,
            "peer_value": self.peer_value,
            "ratio": self.ratio,
            "bar": self.bar,
            "holds": self.holds,
            "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        }
