"""The limit as a method: ensembles of real twins, found by the command that a run follows."""

import numpy as np
import pytest
from scores import simulated_record

from twin.estimation.ensemble import Ensembles
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_method, method_specs
from twin.evaluation.compare import compare
from twin.evaluation.method import build_method
from twin.evaluation.protocol import Protocol
from twin.evaluation.scenarios import SAMPLE_TIME, members, simulate_drives
from twin.evaluation.yardsticks import bounds, make_ensembles
from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")
TIME = np.arange(0, 8, SAMPLE_TIME)
PULLS = [1e-3 * np.sin(2 * np.pi * TIME / 8), 3e-3 + 1e-3 * np.sin(2 * np.pi * TIME / 5)]


@pytest.fixture(scope="module")
def ensembles(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ensembles")
    return make_ensembles(PRESET, RANGES, PULLS, folder, count=40, seed=1)


@pytest.fixture(scope="module")
def test_set():
    """Four twins on each command that are none of the members, at T = 0.1 s."""
    made = []
    for pull, stroke in zip(PULLS, [(-1.0, 1.0), (2.0, 4.0)], strict=True):
        for number, episode in enumerate(simulate_drives(members(PRESET, RANGES, pull, 4, seed=2))):
            bend = episode.truth_deg[::5]
            made.append(
                simulated_record(pull[::5] * 1e3, bend, source="r", stroke_mm=stroke, name=str(number))
            )
    return made


def test_ensembles_are_kept_and_found_again(ensembles):
    written = [path.stat().st_mtime_ns for path in ensembles]
    again = make_ensembles(PRESET, RANGES, PULLS, ensembles[0].parent, count=40, seed=1)
    assert [path.stat().st_mtime_ns for path in again] == written
    assert len(set(ensembles)) == 2
    other = make_ensembles(PRESET, RANGES, PULLS[:1], ensembles[0].parent, count=8, seed=1)
    assert other[0] not in ensembles


def test_a_run_is_weighed_by_the_ensemble_of_its_command(ensembles, test_set):
    method = Ensembles(tuple(ensembles), 0.1)
    for pull in PULLS:
        members_deg = method.along(pull[::5] * 1e3)
        assert np.corrcoef(members_deg.mean(axis=0), pull[::5])[0, 1] > 0.8
    with pytest.raises(ValueError, match="no ensemble"):
        method.along(PULLS[0][::5] * 1e3 + 0.1)


def test_a_record_may_begin_later_than_its_command_and_be_padded(ensembles):
    method, pull = Ensembles(tuple(ensembles), 0.1), PULLS[1][::5] * 1e3
    whole = method.along(pull)
    padded = np.concatenate([pull[7:], np.full(30, pull[-1])])
    np.testing.assert_array_equal(method.along(padded), whole[:, 7:])
    with pytest.raises(ValueError, match="no ensemble"):
        method.along(pull[-5:])  # five samples could be of any command


@pytest.mark.slow
def test_no_method_is_better_than_the_limit_and_it_is_near_its_bound(ensembles, test_set):
    protocol = Protocol("full", seeds=4)
    known = Knowledge(0.1, {}, ensembles=(tuple(ensembles),))
    methods = [build_method(spec, known) for spec in method_specs() if spec.is_ready(known)]
    names = ["Ensemble", "Ensemble with bias", "Particles (families)"]
    assert [method.name for method in methods] == [
        *names,
        "Ensemble (limit)",
        "Ensemble (limit, zero unknown)",
        "Particles (limit)",
    ]
    rows, *_ = compare(test_set, methods, protocol)
    rmse = {(r.method, r.noise, r.level, r.stroke_mm[0]): r.rmse_deg for r in rows}
    for low in (-1.0, 2.0):
        with_r, knows = (rmse[name, "gaussian", 1.0, low] for name in ("Ensemble", "Ensemble (limit)"))
        assert knows == pytest.approx(with_r, rel=0.05)  # R says all of Gaussian noise
        assert knows < 0.6  # the measurement itself: 1
        for noise, level in (("poisson-dithered", 2.0), ("salt-and-pepper", 0.05), ("gamma", 1.0)):
            limit = rmse["Ensemble (limit)", noise, level, low]
            assert limit < 0.7 * rmse["Ensemble", noise, level, low]
            assert rmse["Particles (limit)", noise, level, low] < 1.1 * limit
    found = bounds(test_set, ensembles, 0.1, (("gaussian", 1.0), ("uniform", 1.0)))
    assert [row["noise"] for row in found] == ["gaussian", "gaussian"]  # uniform noise has no bound
    for row in found:
        reached = rmse["Ensemble (limit)", "gaussian", 1.0, row["stroke_mm"][0]]
        assert 0.7 * row["rmse_deg"] < reached < 1.6 * row["rmse_deg"]  # four twins are not the mean of all


def test_further_ensembles_have_other_members_and_are_a_spread(ensembles, test_set):
    """The spread of ensembles that have no twin in common is the uncertainty of each."""
    folder = ensembles[0].parent
    further = make_ensembles(PRESET, RANGES, PULLS, folder, count=20, seed=1, first=40)
    known = Knowledge(0.1, {}, ensembles=(tuple(ensembles), tuple(further)))
    spec = find_method("Ensemble (limit)")
    assert spec is not None
    protocol = Protocol("full", seeds=2)
    rows, *_ = compare(test_set, [build_method(spec, known)], protocol)
    alone = [
        compare(test_set, [build_method(spec, Knowledge(0.1, {}, ensembles=(tuple(of),)))], protocol)[0]
        for of in (ensembles, further)
    ]
    for row, *single in zip(rows, *alone, strict=True):
        assert row.training_rmse_deg == pytest.approx([of.rmse_deg for of in single])
        assert row.training_rmse_deg[0] != row.training_rmse_deg[1]
    both = make_ensembles(PRESET, RANGES, PULLS[:1], folder, count=60, seed=1)
    with np.load(both[0]) as whole, np.load(ensembles[0]) as one, np.load(further[0]) as other:
        apart = np.concatenate([one["bend_deg"], other["bend_deg"]])
        np.testing.assert_allclose(whole["bend_deg"], apart, atol=1e-3)
