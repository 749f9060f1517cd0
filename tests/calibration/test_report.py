"""The report of a calibration compares with each log, and scores apart what was only predicted."""

import numpy as np

from twin.calibration import uncertainty
from twin.calibration.report import fit_figure, fit_report


def test_report_compares_with_each_log_and_draws_it(fitted):
    free, logs, fit, _ = fitted
    values, episodes = fit_report(fit, free, uncertainty(fit, free), logs, seed=0)
    assert [log["name"] for log in values["logs"]] == ["0 rad", "1.5 rad"]
    for log in values["logs"]:
        assert log["rmse_deg"] < 0.05 < log["coleman_hodgdon_rmse_deg"]
        assert log["tension_a_rmse_percent_of_range"] < 1
    axes = fit_figure(logs, episodes).axes
    assert len(axes) == 4
    np.testing.assert_allclose(axes[0].lines[0].get_ydata(), np.degrees(logs[0].bend))


def test_log_that_is_only_predicted_is_scored_apart(fitted):
    free, logs, fit, _ = fitted
    shown = [logs[0], logs[1].only_predicted()]
    values, _ = fit_report(fit, free, uncertainty(fit, free), shown, seed=0)
    seen, unseen = values["logs"]
    assert seen["held_out_rmse_deg"] is None
    assert unseen["rmse_deg"] is None
    assert unseen["coleman_hodgdon_rmse_deg"] is None
    assert unseen["held_out_rmse_deg"] < 0.05
    assert unseen["tension_a_rmse_percent_of_range"] < 1
