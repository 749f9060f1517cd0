from typing import Any

import pytest
from calibrating import loops, start_of

from twin.calibration import Fit, FreeParameters, MeasuredLoop, calibrate, free_parameters


@pytest.fixture(scope="session")
def fitted() -> tuple[FreeParameters, list[MeasuredLoop], Fit, list[Any]]:
    """Three parameters fitted to two simulated logs: the parameters, the logs, the fit, and its progress."""
    logs = loops(0.0, 1.5)
    free = free_parameters(
        start_of(sheath_friction=0.15, wire_stiffness=2e3, section_stiffness=0.04),
        logs,
        ("section_stiffness", "wire_stiffness", "sheath_friction"),
    )
    reports: list[Any] = []
    fit = calibrate([free], logs, seed=0, starts=2, on_progress=lambda *news: reports.append(news))
    return free, logs, fit, reports
