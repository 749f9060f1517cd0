"""The sealed conditions: drawn by a seed, two kinds of physics each, a stated R; recorded as they were."""

import dataclasses

import numpy as np
import pytest
from controlled import PRESET, knowledge

from twin.control.conditions import CAPSTAN, ControlSettings
from twin.control.results import MEASURES, ControlResult, pooled, write_record
from twin.control.sealed import CONDITIONS, FIELDS, PARAMETERS, SENSORS, draw_conditions
from twin.control.trial import run_trial
from twin.evaluation.sealed import FAMILIES
from twin.preset import load_ranges
from twin.recording import read_episode

SETTINGS = ControlSettings(PRESET, load_ranges("ureteroscope"), ((-1.0, 1.0),), twins=1, seconds=3.0)
KNOWN = knowledge(stroke_mm=(-1.0, 1.0), sample_time=0.02)
DRAWN = [condition for seed in range(8) for condition in draw_conditions(seed, 20.0)]


def test_a_seed_has_its_own_conditions_of_few_sensors():
    assert draw_conditions(2**63 + 7, 20.0) == draw_conditions(2**63 + 7, 20.0)
    drawn, other = draw_conditions(5, 20.0), draw_conditions(6, 20.0)
    assert len({of.slug for of in drawn}) == len({of.seed for of in drawn}) == CONDITIONS
    assert len({of.sensor for of in drawn}) == SENSORS
    assert {of.seed for of in drawn}.isdisjoint(of.seed for of in other)
    assert {of.sensor for of in drawn}.isdisjoint(of.sensor for of in other)


@pytest.mark.parametrize("condition", DRAWN[:24], ids=lambda condition: condition.name)
def test_a_condition_has_the_two_kinds_of_its_name_within_their_ranges(condition):
    found = {name: getattr(condition, name) for name, _ in FIELDS.values()} | dict(condition.changes)
    kinds = condition.name.partition(": ")[2].partition(";")[0].split(", ")
    assert len(kinds) == 2
    for kind, (name, (low, high)) in (FIELDS | PARAMETERS).items():
        assert (low <= found.get(name, 0.0) <= high) is (kind in kinds)
    assert found.get("sheath_friction") != dict(CAPSTAN)["sheath_friction"]
    assert 4.0 <= condition.begins_s <= 14.0


def test_every_kind_of_physics_and_noise_is_drawn():
    names = " ".join(condition.name for condition in DRAWN)
    assert all(kind in names for kind in (*FIELDS, *PARAMETERS, *FAMILIES))


def test_the_errors_of_a_sensor_have_the_r_that_controllers_are_given():
    for condition in DRAWN[:CONDITIONS]:
        white = dataclasses.replace(condition.errors, correlation_s=0.0, changes_at=1.0)
        noise = dataclasses.replace(condition, errors=white).draw_noise(100_000, np.random.default_rng(0))
        assert noise.var() == pytest.approx(condition.variance, rel=0.3)
        assert noise.mean() == pytest.approx(0, abs=0.05 * np.sqrt(condition.variance))


def test_conditions_have_endoscopes_references_and_noise_of_their_own():
    first, second = ([*SETTINGS.cases(condition, KNOWN)] for condition in DRAWN[:2])
    assert {case.preset for case in first}.isdisjoint(case.preset for case in second)
    assert not np.array_equal(first[0].reference_deg, second[0].reference_deg)
    assert not np.isin(first[0].noise_deg, second[0].noise_deg).any()


def test_the_recording_of_a_disturbed_trial_has_its_angles(tmp_path):
    condition = dataclasses.replace(DRAWN[0], bends_by=0.5, tip_force=0.2, begins_s=0.5)
    case = SETTINGS.cases(condition, KNOWN)[0]
    trial = run_trial("linear", KNOWN, case)
    path = write_record(tmp_path, trial, SETTINGS, condition, "linear")
    np.testing.assert_allclose(read_episode(path).truth_deg, trial.truth_deg, atol=1e-9)
    undisturbed = run_trial("linear", KNOWN, SETTINGS.cases(DRAWN[0], KNOWN)[0])
    assert np.abs(undisturbed.truth_deg - trial.truth_deg).max() > 0.5


def test_all_conditions_together_are_their_endoscopes():
    def result(condition, rmse):
        measures = dict.fromkeys(MEASURES, np.full((1, 2, 3), rmse))
        return ControlResult("pid", condition, SETTINGS.strokes_mm, measures, {})

    (together,) = pooled([result(DRAWN[0], 3.0), result(DRAWN[1], 4.0)])
    assert together.rmse_deg == pytest.approx(np.sqrt((9 + 16) / 2))
    np.testing.assert_allclose(together.by_twin_deg, [3, 3, 4, 4])
