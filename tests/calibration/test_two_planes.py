"""Logs of two planes: each plane has an unknown zero of its own, is scored, and is drawn."""

import dataclasses
import json

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH

from twin.calibration import Fit, free_parameters, measured_loop
from twin.calibration.compared import compare
from twin.calibration.figure import fit_figure
from twin.calibration.files import log_summary, write_fit
from twin.calibration.objective import OFFSET_SPREAD, PRIOR, residuals
from twin.physics import simulate
from twin.preset.file import load_preset

TWO = TRUTH.replace(bending_planes=2)
PHASE = np.arange(80) * 2 * np.pi / 50


@pytest.fixture(scope="module")
def simulated():
    pulls = 3e-3 * np.sin(PHASE), 2e-3 * np.cos(PHASE)
    return simulate(TWO, pulls[0], SAMPLE_TIME, lateral_pull=pulls[1])


def log_of(episode, own=0.0, lateral=0.0):
    """Log of a sensor whose zeros are off by two angles [deg]."""
    turned = {
        "measured_bend": episode.bend - np.radians(own),
        "lateral_bend": episode.lateral_bend - np.radians(lateral),
    }
    facts = {"source": "measured", "file_sha256": "a"}
    return dataclasses.replace(episode, wire_tension=np.empty((80, 4, 0)), metadata=facts, **turned)


def loop_of(episode, *zeros):
    return measured_loop(log_of(episode, *zeros), "a log", SAMPLE_TIME)


def test_each_plane_has_a_zero_of_its_own(simulated):
    off = residuals([TWO], [loop_of(simulated, 3.0, -5.0)], weight=PRIOR)[0]
    np.testing.assert_allclose(off[:-2], 0, atol=1e-4)
    spread = np.degrees(OFFSET_SPREAD)
    np.testing.assert_allclose(off[-2:], [PRIOR * 3 / spread, -PRIOR * 5 / spread], atol=1e-4)


def test_both_planes_are_fitted_reported_and_drawn(simulated, tmp_path):
    loops = [loop_of(simulated, 3.0, -5.0), loop_of(simulated, 1.0, 2.0).only_predicted()]
    free = free_parameters(TRUTH.replace(name="start"), loops, ("joint_friction", "lateral_initial_bend"))
    assert free.base.bending_planes == 2
    off = residuals([TWO], loops)[0]
    jacobian = np.random.default_rng(0).normal(size=(len(off), 2))
    fit = Fit(free, TWO, float(off @ off), float(off @ off), jacobian, off)
    values = write_fit(tmp_path / "x.yaml", fit, loops[:1], loops[1:], 0, ["coleman-hodgdon"])
    fitted, predicted = json.loads((tmp_path / "x_fit.json").read_text())["logs"]
    assert values["logs"] == [fitted, predicted]
    assert (fitted["offset_deg"], fitted["lateral_offset_deg"]) == pytest.approx((-3, 5), abs=1e-3)
    assert fitted["lateral_rmse_deg"] < 1e-3 < 0.1 < fitted["lateral_coleman_hodgdon_rmse_deg"]
    assert predicted["lateral_rmse_deg"] is None
    assert predicted["lateral_held_out_rmse_deg"] == pytest.approx(2, abs=1e-3)
    assert predicted["lateral_held_out_centred_rmse_deg"] < 1e-3
    assert log_summary(fitted) == "a log RMSE 0.00 deg, sideways 0.00"
    assert log_summary(predicted) == "a log predicted within 2.00 deg, sideways 2.00"
    assert load_preset(tmp_path / "x.yaml").bending_planes == 2
    one, other = compare(TWO, loops)
    nothing = tuple({"twin": None} for _ in other.errors)
    axes = fit_figure([one, dataclasses.replace(other, episode=None, errors=nothing)]).axes
    assert len(axes) == 8  # bend and error, in two planes, of two logs
    measured, twin = axes[4].lines
    np.testing.assert_allclose(measured.get_ydata(), np.degrees(loops[0].episode.lateral_bend))
    np.testing.assert_allclose(twin.get_ydata(), measured.get_ydata(), atol=1e-6)
    np.testing.assert_allclose(measured.get_xdata(), 2 * np.cos(PHASE))
    assert [len(axis.lines) for axis in axes] == [2, 1, 2, 1, 2, 1, 2, 1]
