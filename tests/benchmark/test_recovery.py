"""Known endoscopes: drawn as reports, their logs disturbed, distances counted in standard deviations."""

import numpy as np
import pytest

from scripts.benchmarks import physics as recovery
from scripts.benchmarks.physics import SPREAD, USUAL, deviations, drawn, logs_of
from twin.calibration.parameters import free_parameters
from twin.calibration.search import Fit
from twin.calibration.uncertainty import uncertainty
from twin.preset.file import load_preset

BASE = load_preset("vio_com").replace(**USUAL)


def test_drawn_endoscopes_differ_in_every_parameter_by_its_spread():
    rng = np.random.default_rng(0)
    endoscopes = [drawn(BASE, rng) for _ in range(300)]
    for name, spread in SPREAD.items():
        values = np.array([getattr(one, name) for one in endoscopes])
        away = values if name in ("initial_bend", "joint_friction_taper") else np.log(values)
        assert away.std() == pytest.approx(spread, rel=0.2), name
    assert {one.vertebrae for one in endoscopes} == {BASE.vertebrae}


@pytest.fixture
def loops(monkeypatch):
    monkeypatch.setattr(recovery, "LOG_SECONDS", 10.0)
    monkeypatch.setattr(recovery, "LOG_PERIOD", 5.0)
    return logs_of(BASE, 9e-3, np.random.default_rng(1))


def test_distances_are_those_of_the_parameters_that_are_determined(loops):
    free = free_parameters(BASE, loops, ("wire_stiffness", "initial_bend", "routing_friction"))
    residual = 0.01 * np.random.default_rng(2).standard_normal(300)
    jacobian = np.random.default_rng(3).standard_normal((300, 3)) * [
        1.0,
        1.0,
        1e-4,
    ]  # the last is undetermined
    found = BASE.replace(wire_stiffness=BASE.wire_stiffness * 1.01, initial_bend=0.001)
    fit = Fit(free, found, 1.0, 1.0, jacobian, residual)
    known = uncertainty(fit).deviation
    away = deviations(fit, BASE)
    assert away.keys() == {"wire_stiffness", "initial_bend"}
    assert away["initial_bend"] == pytest.approx(0.001 / known["initial_bend"])
    relative = known["wire_stiffness"] / found.wire_stiffness
    assert away["wire_stiffness"] == pytest.approx(np.log(1.01) / relative)
