"""Sealed conditions: drawn by the files under test, from the stated distributions, alike for all methods."""

import csv
import dataclasses
import json

import briefly
import numpy as np
import pytest

from scripts.evaluate import main
from twin.estimation.active_model import ActiveModel
from twin.evaluation.method import Filtering, Method
from twin.evaluation.ranking import rank_conditions
from twin.evaluation.sealed import (
    FAMILIES,
    LEVELS,
    SealedSensor,
    draw_conditions,
    sealed_case,
    sealed_seed,
    simulate_conditions,
    simulate_members,
)
from twin.evaluation.sealed_scores import compare_sealed, sealed_scores, summary_of
from twin.preset import load_preset, load_ranges
from twin.simulation import simulate

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")
T = 0.1


@pytest.fixture(scope="module")
def conditions():
    return draw_conditions(PRESET, RANGES, 6.0, seed=3, count=12)


@pytest.fixture(scope="module")
def sealed_records(conditions):
    return simulate_conditions(conditions, T)


def measurement_itself(case):
    return np.where(np.isnan(case.measurement_deg), case.truth_deg, case.measurement_deg)


def sensor_of(kind, level, **more):
    return SealedSensor(kind, level, 4.0, **{"zero_deg": 0.0, "zero_deviation_deg": 0.0} | more)


def test_another_file_or_number_is_another_test_set_and_a_copy_is_the_same(tmp_path):
    one, copy, other = (tmp_path / name for name in "abc")
    one.write_bytes(b"policy")
    copy.write_bytes(b"policy")
    other.write_bytes(b"policy.")
    assert sealed_seed([one], 0) == sealed_seed([copy], 0)
    assert sealed_seed([one, other], 0) == sealed_seed([other, copy], 0)
    assert (
        len({sealed_seed([one], 0), sealed_seed([one], 1), sealed_seed([other], 0), sealed_seed([], 0)}) == 4
    )


def test_a_condition_does_not_depend_on_how_many_there_are(conditions):
    again = draw_conditions(PRESET, RANGES, 6.0, seed=3, count=5)
    assert [of.facts() for of in again] == [of.facts() for of in conditions[:5]]
    assert all(np.array_equal(a.pull, b.pull) for a, b in zip(again, conditions, strict=False))


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("share", [0.2, 0.9])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_family_has_the_stated_variance_and_mean(family, share, sign):
    low, high = FAMILIES[family].shapes
    level = max(low + share * (high - low), 5.0 if family == "student-t" else 0.0)
    sensor = sensor_of(family, level, sign=sign, zero_deg=1.5, correlation_s=0.05)
    errors = sensor.errors(np.zeros(200_000), T, np.random.default_rng(1))
    assert errors.mean() == pytest.approx(1.5, abs=0.03)
    assert errors.var() == pytest.approx(4.0, rel=0.06)


def test_a_mirrored_family_is_skewed_to_the_other_side():
    right, left = (
        sensor_of("gamma", 1.0, sign=sign).errors(np.zeros(50_000), T, np.random.default_rng(2))
        for sign in (1.0, -1.0)
    )
    assert np.mean(right**3) > 8
    assert np.mean(left**3) < -8


def test_noise_with_a_memory_is_correlated_over_the_stated_time():
    errors = sensor_of("gaussian", 1.0, correlation_s=0.5).errors(
        np.zeros(100_000), T, np.random.default_rng(3)
    )
    correlation = np.mean(errors[5:] * errors[:-5]) / errors.var()
    assert correlation == pytest.approx(np.exp(-1), abs=0.03)


def test_the_deviation_changes_where_it_is_stated():
    errors = sensor_of("gaussian", 1.0, changes_at=0.5, change=2.0).errors(
        np.zeros(40_000), T, np.random.default_rng(4)
    )
    assert errors[20_000:].std() / errors[:20_000].std() == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize("kind", LEVELS)
def test_a_faulty_sensor_errs_about_the_angle(kind):
    bend = 30 * np.sin(np.linspace(0, 20, 2000))
    errors = sensor_of(kind, LEVELS[kind][1]).errors(bend, T, np.random.default_rng(5))
    assert 0.05 < np.nanstd(errors) < 15


def test_a_record_begins_where_its_history_ends(conditions, sealed_records):
    for condition, record in zip(conditions, sealed_records, strict=True):
        assert len(record.time) == 60
        assert np.allclose(record.pull_mm, condition.pull[::5] * 1e3)
        assert condition.from_rest == (condition.begin == 0)
    number = next(
        k for k, of in enumerate(conditions) if of.drive.twin == "sheath still" and not of.from_rest
    )
    condition = conditions[number]
    from_rest = simulate(condition.drive.preset, condition.pull, 0.02).truth_deg[::5]
    assert np.abs(from_rest - sealed_records[number].truth_deg)[0] > 1e-3


def test_members_follow_the_command_and_each_has_a_history_of_its_own(conditions):
    for from_rest in (True, False):
        condition = next(of for of in conditions if of.from_rest is from_rest)
        bend = simulate_members(condition, PRESET, RANGES, 8, 0, T)
        assert bend.shape == (8, 60)
        still = simulate_members(dataclasses.replace(condition, from_rest=True), PRESET, RANGES, 8, 0, T)
        assert np.array_equal(bend, still) is from_rest


def test_all_methods_meet_the_same_errors_and_only_oracles_the_truth(conditions, sealed_records):
    seen = []

    def look(case):
        seen.append(case)
        return np.zeros(case.measurement_deg.shape)

    methods = [Method("zero", look), Method("measurement", measurement_itself, oracle=True)]
    results = compare_sealed(conditions, sealed_records, methods, 3, 7)
    assert all(case.truth_deg is None for case in seen)
    assert {case.from_rest for case in seen} == {True, False}
    for number, (condition, record) in enumerate(zip(conditions, sealed_records, strict=True)):
        case = sealed_case([(number, condition)], [record], 3, 7)
        errors = measurement_itself(case) - case.truth_deg
        rmse = np.sqrt((errors[:, 1:] ** 2).mean(axis=1)).mean()
        assert results["measurement"].rmse_deg[number] == pytest.approx(rmse)
        truth = record.truth_deg[1:]
        assert results["zero"].rmse_deg[number] == pytest.approx(np.sqrt((truth**2).mean()))
        assert case.initial_bend_deg[0] - record.truth_deg[0] == pytest.approx(condition.initial_error_deg)


def test_a_row_is_the_geometric_mean_over_conditions(conditions, sealed_records):
    methods = [
        Method("zero", lambda case: np.zeros(case.measurement_deg.shape)),
        Method("one", lambda case: np.ones(case.measurement_deg.shape)),
    ]
    results = compare_sealed(conditions, sealed_records, methods, 2, 7)
    scores, rankings = sealed_scores(conditions, methods, results, T)
    everything = next(score for score in scores if score.method == "zero")
    assert everything.level == len(conditions)
    assert everything.rmse_deg == pytest.approx(np.exp(np.log(results["zero"].rmse_deg).mean()))
    assert rankings[0].ranked[0].rmse_deg == pytest.approx(everything.rmse_deg)
    summary = summary_of("zero", results)
    ratio = results["zero"].rmse_deg / results["one"].rmse_deg
    assert summary.rival == "one"
    assert summary.ratio == pytest.approx(np.exp(np.log(ratio).mean()))
    assert summary.worse == pytest.approx((ratio > 1).mean())


def test_an_estimator_knows_that_the_history_is_unknown(conditions, sealed_records, model):
    known = []

    class Asked(ActiveModel):
        def begun(self, from_rest, initial_deviation_deg=np.inf):
            known.append(from_rest)
            return self

    filtering = Filtering(Asked(model, T))
    compare_sealed(conditions[:6], sealed_records[:6], [Method("asked", filtering)], 1, 7)
    assert known == [False] * len({of.from_rest for of in conditions[:6] if not of.from_rest})


def test_intervals_of_equal_methods_are_honest():
    """95 % of the intervals of the ratio of two equal methods hold 1, at 200 conditions and 5 trainings."""
    rng = np.random.default_rng(8)
    held, won = [], []
    for _ in range(400):
        common = rng.standard_normal(200)
        logs = {
            name: common + 0.05 * rng.standard_normal((5, 1)) + 0.3 * rng.standard_normal((5, 200))
            for name in "ab"
        }
        ranked = rank_conditions(logs)
        low, high = next(of.to_best_ci95 for of in ranked if of.rank == 2)
        held.append(low <= 1 <= high)
        won.append(any(of.noise_is_best[0] for of in ranked))
    assert 0.92 <= np.mean(held) <= 0.99
    assert np.mean(won) <= 0.06


FEW = "--suite sealed --seconds 5 --seeds 2 --members 8 --methods C-H AM Ensemble --json"


@pytest.fixture(scope="module")
def brief(in_one_process):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rl.comparison.sealed.CONDITIONS", 6)
        patch.setattr("twin.evaluation.fitting.GENERATIONS", 20)
        briefly.tune_filters(patch)
        yield


def test_a_run_is_kept_with_its_conditions_and_counted(brief, tmp_path, capsys):
    for number in ("0", "0", "1"):
        assert main([*FEW.split(), "--out", str(tmp_path / "out"), "--seed", number]) == 0
    contents = json.loads((tmp_path / "out/evaluation.json").read_text())
    assert contents["protocol"]["test_sets_in_this_folder"] == 2
    assert contents["protocol"]["number"] == 1
    assert [row["method"] for row in contents["rows"][:3]] == ["C-H", "AM", "Ensemble"]
    lines = list(csv.DictReader((tmp_path / "out/conditions.csv").read_text().splitlines()))
    assert len(lines) == 6
    of_active = np.log([float(line["rmse_deg of AM"]) for line in lines]).mean()
    assert contents["rows"][1]["rmse_deg"] == pytest.approx(np.exp(of_active), rel=1e-4)
    runs = list(csv.DictReader((tmp_path / "out/sealed_runs.csv").read_text().splitlines()))
    of_active = [run["rmse_deg"] for run in runs if run["method"] == "AM"]
    assert of_active[0] == of_active[1] != of_active[2]
    assert "| AM " in (tmp_path / "out/sealed.md").read_text()


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ("data", "--suite sealed draws its own conditions: name no records"),
        ("--sample-time 0.1 0.02", "--sample-time: the sealed suite takes one"),
        ("--measurements recorded", "--suite sealed draws its own conditions: name no records"),
    ],
)
def test_a_mistake_is_one_line_before_any_work(flags, message, tmp_path, capsys):
    assert main(["--suite", "sealed", "--out", str(tmp_path / "out"), *flags.split()]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.glob("out/*"))
