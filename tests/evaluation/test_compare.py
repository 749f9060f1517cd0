import dataclasses

import numpy as np
import pytest
from scores import simulated_record

from twin.evaluation.compare import compare
from twin.evaluation.method import Method, make_case
from twin.evaluation.paper import paper_value
from twin.evaluation.protocol import PAPER_CONDITIONS, Protocol
from twin.report.tables import paper_tables
from twin.signals.noise import noise_variance

PROTOCOL = Protocol(suite="paper-only", seeds=6, seed=4)


@pytest.fixture
def two_records(records):
    return [
        simulated_record(pull, bend, name=f"record {number}")
        for number, (pull, bend) in enumerate(records[:2])
    ]


def measurement_itself(case):
    estimate = case.measurement_deg.copy()
    estimate[:, 0] = case.initial_bend_deg
    return estimate


def pick(rows, method, noise, level):
    (row,) = [r for r in rows if (r.method, r.noise, r.level) == (method, noise, level)]
    return row


def test_trusting_the_measurement_scores_the_moments_of_the_noise(two_records):
    rows, *_ = compare(two_records, [Method("y", measurement_itself)], Protocol("paper", 200, seed=1))
    for noise, level in PAPER_CONDITIONS:
        row = pick(rows, "y", noise, level)
        mean = level if noise == "poisson" else 0.0
        assert row.bias_deg == pytest.approx(mean, abs=0.03)
        assert row.var_deg2 == pytest.approx(level, rel=0.03)
        assert row.rmse_deg == pytest.approx(np.sqrt(level + mean**2), rel=0.02)
        low, high = row.rmse_ci95_deg
        assert low < row.rmse_deg < high
    dithered = pick(rows, "y", "poisson-dithered", 1.0)
    assert dithered.var_deg2 == pytest.approx(1 + 1 / 12, rel=0.03)


def test_wrong_initial_estimate_is_given_and_not_scored(two_records):
    seen = []

    def perfect_after_the_first(case):
        seen.append(case.initial_bend_deg)
        estimate = case.truth_deg.copy()
        estimate[:, 0] = case.initial_bend_deg
        return estimate

    rows, *_ = compare(two_records, [Method("p", perfect_after_the_first, oracle=True)], PROTOCOL)
    assert all(row.rmse_deg == 0 for row in rows)
    np.testing.assert_allclose(
        seen[0], np.repeat([record.truth_deg[0] + 20 for record in two_records], 5 * 6)
    )


def test_only_an_oracle_is_shown_the_truth(two_records):
    shown = {}

    def look(name):
        def estimate(case):
            shown[name] = case.truth_deg
            return case.measurement_deg

        return estimate

    rows, *_ = compare(two_records, [Method("a", look("a")), Method("b", look("b"), oracle=True)], PROTOCOL)
    assert shown["a"] is None
    assert shown["b"] is not None
    assert {row.method: row.oracle for row in rows} == {"a": False, "b": True}


def test_same_seed_same_rows_and_methods_share_the_noise(two_records):
    methods = [Method("one", measurement_itself), Method("two", measurement_itself)]
    rows, *_ = compare(two_records, methods, PROTOCOL)
    again, *_ = compare(two_records, methods, PROTOCOL)
    assert rows == again
    assert pick(rows, "one", "gaussian", 1.0).mae_deg == pick(rows, "two", "gaussian", 1.0).mae_deg
    other, *_ = compare(two_records, methods, Protocol("paper-only", 6, seed=5))
    assert other[0].mae_deg != rows[0].mae_deg


def test_several_trainings_are_one_row_with_their_mean_and_spread(two_records):
    """Trainings that are off by 1, 2 and 4 deg: RMSE and bias are means over them."""

    def off(by):
        def estimate(case):
            return case.truth_deg + by

        return estimate

    method = Method("m", off(1.0), oracle=True, others=(off(2.0), off(4.0)))
    rows, tracks, *_ = compare(two_records, [method, Method("one", off(1.0), oracle=True)], PROTOCOL)
    for row in rows:
        if row.method == "one":
            assert row.training_rmse_deg == ()
            continue
        assert row.training_rmse_deg == pytest.approx((1, 2, 4))
        assert row.rmse_deg == row.bias_deg == pytest.approx(7 / 3)
        low, high = row.rmse_ci95_deg
        half = 4.302653 * np.std([1, 2, 4], ddof=1) / np.sqrt(3)  # t(0.975, 2) from the table
        assert (low, high) == pytest.approx((7 / 3 - half, 7 / 3 + half), rel=1e-6)
    np.testing.assert_allclose(next(iter(tracks.values())).error_deg("m"), 1)


def test_tracks_hold_the_first_record_and_seed_of_every_noise(two_records):
    _, tracks, *_ = compare(two_records, [Method("y", measurement_itself)], PROTOCOL)
    assert list(tracks) == list(PAPER_CONDITIONS)
    for track in tracks.values():
        np.testing.assert_array_equal(track.truth_deg, two_records[0].truth_deg)
        np.testing.assert_array_equal(track.estimates["y"][1:], track.measured_deg[1:])
        assert track.time[1] == pytest.approx(0.1)


def test_the_papers_figure_stands_in_the_row_of_its_method(two_records):
    methods = [Method("RAM", measurement_itself), Method("y", measurement_itself)]
    of_paper = [dataclasses.replace(record, preset="ureteroscope") for record in two_records]
    rows, *_ = compare(of_paper, methods, PROTOCOL)
    assert pick(rows, "RAM", "gaussian", 1.0).paper_rmse_deg == 0.6354
    assert pick(rows, "y", "gaussian", 1.0).paper_rmse_deg is None
    assert "(paper 0.635)" in paper_tables(rows)
    for records in (
        two_records,
        [of_paper[0], two_records[1]],
    ):  # of another instrument, in one group or whole
        rows, *_ = compare(records, methods, PROTOCOL)
        assert {row.paper_rmse_deg for row in rows} == {None}
        assert "RAM" in paper_tables(rows)
        assert "paper" not in paper_tables(rows)
    assert paper_value("poisson", 2.0, "C-H", "mae_deg") == 4.4908


@pytest.mark.parametrize(
    ("change", "message"), [({"suite": "ful"}, "valid: paper, paper-only, full"), ({"seeds": 0}, "seeds = 0")]
)
def test_protocol_that_cannot_run_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Protocol(**change)


def test_where_the_truth_is_not_known_nothing_is_measured_and_nothing_scored(two_records):
    seen = np.ones(200, bool)
    seen[80:120] = False
    gap = dataclasses.replace(two_records[0], truth_deg=np.where(seen, two_records[0].truth_deg, np.nan))
    cases = []

    def wrong_in_the_gap(case):
        cases.append(case)
        estimate = case.truth_deg.copy()
        estimate[:, 80:120] += 100
        return estimate

    rows, *_ = compare([gap], [Method("g", wrong_in_the_gap, oracle=True)], PROTOCOL)
    assert all(row.rmse_deg == 0 for row in rows)
    np.testing.assert_array_equal(np.isnan(cases[0].measurement_deg), np.tile(~seen, (30, 1)))


def test_a_shorter_record_is_padded_without_measurements_and_scored_to_its_end(two_records):
    short = two_records[1].part(0, 150)

    def off_after_the_end(case):
        estimate = case.truth_deg + 1.0
        estimate[30:, 150:] = 1e6  # the second record's runs
        return estimate

    rows, *_ = compare([two_records[0], short], [Method("o", off_after_the_end, oracle=True)], PROTOCOL)
    assert rows[0].rmse_deg == pytest.approx(1.0)
    case = make_case([(0, two_records[0]), (1, short)], PROTOCOL)
    assert np.isnan(case.measurement_deg[30:, 150:]).all()
    assert (case.pull_mm[30:, 150:] == short.pull_mm[-1]).all()


def test_runs_know_variance_and_bound_of_their_own_noise(two_records):
    case = make_case(list(enumerate(two_records)), Protocol("full", seeds=3))
    assert case.noises[:6] == (("gaussian", 1.0),) * 3 + (("gaussian", 5.0),) * 3
    error = case.measurement_deg - case.truth_deg
    for run, (kind, level) in enumerate(case.noises):
        assert case.sensor.variance[run] == noise_variance(kind, level)
        assert np.isfinite(case.sensor.bound[run]) == (kind == "uniform")
        missing = np.isnan(error[run])
        assert (np.abs(error[run][~missing]) <= case.sensor.bound[run]).all()
        assert kind == "stereo-vision" or not missing.any()


def test_a_seed_draws_the_same_noise_however_many_there_are(two_records):
    few, many = (
        make_case([(0, two_records[0])], Protocol("paper-only", seeds)).measurement_deg for seeds in (2, 5)
    )
    np.testing.assert_array_equal(many[:2], few[:2])
    assert not np.array_equal(many[0], many[1])
