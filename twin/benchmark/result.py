"""One line of `benchmark.json`: a figure, beside a peer's where there is one."""

import dataclasses
import os
import platform
from typing import Any


@dataclasses.dataclass(frozen=True)
class Result:
    """A measured figure."""

    name: str
    value: float
    unit: str
    bar: str
    """What must hold, in words; empty where nothing was promised."""
    holds: bool = True
    peer: str | None = None
    """What it is compared with, in the same run."""
    peer_value: float | None = None

    @property
    def ratio(self) -> float | None:
        """The value over the peer's."""
        return None if not self.peer_value else self.value / self.peer_value

    def to_dict(self) -> dict[str, Any]:
        """Return it as `benchmark.json` holds it."""
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
