"""The report of a calibration compares with each log, and scores apart what was only predicted."""

import dataclasses
import json
import math

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH, changed

from twin.calibration import compared, figure, measured_loop, uncertainty
from twin.calibration.compared import compare
from twin.calibration.figure import fit_figure
from twin.calibration.files import fit_report, log_summary, with_sheaths_of, write_fit
from twin.errors import InputError
from twin.physics import simulate
from twin.preset import Ranges, load_preset, load_ranges


def test_report_compares_with_each_log_and_draws_it(fitted):
    _, logs, fit, _ = fitted
    both = compare(fit.preset, logs, rivals=["coleman-hodgdon"])
    values = fit_report(fit, uncertainty(fit), both, seed=0)
    assert [log["name"] for log in values["logs"]] == ["0 rad", "1.5 rad"]
    for log in values["logs"]:
        assert log["rmse_deg"] < 0.05 < log["coleman_hodgdon_rmse_deg"]
        assert log["tension_a_rmse_percent_of_range"] < 1
    axes = fit_figure(both).axes
    assert len(axes) == 6  # bend, error and tension of each
    measured, simulated = (line.get_ydata() for line in axes[0].lines)
    np.testing.assert_allclose(measured, np.degrees(logs[0].episode.bend))
    np.testing.assert_allclose(simulated, np.degrees(both[0].episode.bend), atol=0.05)
    np.testing.assert_allclose(axes[2].lines[-1].get_ydata(), simulated - measured, atol=1e-9)


def test_a_predicted_log_that_began_elsewhere_is_also_compared_from_there():
    pull = 4e-3 * np.sin(2 * np.pi * np.arange(0, 3, SAMPLE_TIME) / 2.5)
    before = np.concatenate([np.linspace(0, 3e-3, 20), np.linspace(3e-3, 0, 20)[1:]])
    after = simulate(TRUTH, np.concatenate([before, pull]), SAMPLE_TIME).part(len(before))
    log = dataclasses.replace(measured_loop(after, "log", SAMPLE_TIME), offset=True).only_predicted()
    (found,) = compare(TRUTH, [log])
    (centred,) = (error["twin"] - error["twin"].mean() for error in found.errors)
    assert np.degrees(found.own_start.std()) < 0.1 < 0.3 * np.degrees(centred.std())
    assert compare(TRUTH, [dataclasses.replace(log, offset=False)])[0].own_start is None


def test_twins_of_a_calibrated_preset_have_the_sheath_bends_of_its_logs(fitted, tmp_path):
    _, logs, fit, _ = fitted
    write_fit(tmp_path / "p.yaml", fit, logs, [], 0)
    assert load_preset(tmp_path / "p.yaml").sheath_bend == 0.75
    assert ("sheath_bend", 0.0, 1.5) in load_ranges(str(tmp_path / "p.yaml")).limits


def test_sheath_bend_has_no_range_where_logs_share_it_or_do_not_all_state_it(fitted):
    _, (straight, bent), fit, _ = fitted
    unstated = changed(straight, sheath_bend=np.empty(0))
    for logs, bend in [([bent, bent], 1.5), ([unstated, bent], fit.preset.sheath_bend)]:
        preset, ranges = with_sheaths_of(fit.preset, Ranges(()), logs)
        assert (preset.sheath_bend, ranges.limits) == (bend, ())


def none_of_it(*args, **options):
    raise InputError("a rule of identification")


@pytest.mark.parametrize("trouble", ["slack wire", "diverges", "no model", "blind"])
def test_preset_is_written_whatever_the_report_cannot_say(fitted, tmp_path, monkeypatch, trouble):
    _, logs, fit, _ = fitted
    if trouble == "slack wire":
        odd = r"$\frac$ {{<b>"
        logs = [dataclasses.replace(changed(log, tension=log.tension * [1, 0]), name=odd) for log in logs]
        monkeypatch.setattr(figure, "MOST_DRAWN", 1)
    if trouble == "diverges":
        simulated = compared.predict
        monkeypatch.setattr(compared, "predict", lambda *args: [[None, *simulated(*args)[0][1:]]])
    if trouble == "no model":
        monkeypatch.setattr(compared, "identify", none_of_it)
    if trouble == "blind":
        fit = dataclasses.replace(fit, jacobian=np.where([True, False, False], fit.jacobian, 0.0))
        fit.jacobian[:, 2] = math.nan
    values = write_fit(tmp_path / "p.yaml", fit, logs, [], 0, ["coleman-hodgdon"])
    assert load_preset(tmp_path / "p.yaml").section_stiffness == pytest.approx(fit.preset.section_stiffness)
    assert json.loads((tmp_path / "p_fit.json").read_text()) == values
    assert (tmp_path / "p_fit.png").is_file()
    assert all(log_summary(log) for log in values["logs"])
    if trouble == "slack wire":
        assert values["logs"][0]["tension_b_rmse_percent_of_range"] is None
        assert values["logs"][0]["tension_b_rmse_n"] > 0
    if trouble == "diverges":
        assert any("diverges along 0 rad" in warning for warning in values["warnings"])
    if trouble == "blind":
        assert sum("the logs do not depend on it" in warning for warning in values["warnings"]) == 2
