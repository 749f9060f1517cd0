"""Ranks by a paired bootstrap: on methods whose errors are known, and whose intervals can be counted."""

import dataclasses
import json
import math

import numpy as np
import pytest

from twin.errors import InputError
from twin.evaluation import ranking
from twin.evaluation.ranking import Ranking, competes, rank_methods, rankings_of, times_reference

C, R, S = 2, 8, 12


def rng(seed=0):
    return np.random.default_rng(seed)


def shared(seed=0, spread=0.6):
    """Square errors that all methods have in common, as records and noise are: (1, C, R, S) [deg^2]."""
    random = rng(seed)
    of_record = random.lognormal(0.0, spread, size=(1, 1, R, 1))
    return of_record * random.lognormal(0.0, 0.2, size=(1, C, R, S))


def named(ranked):
    return {of.method: of for of in ranked}


def test_what_all_have_in_common_widens_no_difference():
    """Twice the RMSE on every run is twice, whichever runs are drawn; each by itself is uncertain."""
    common = shared()
    found = named(rank_methods({"one": common, "two": 4 * common}, (), rng()))
    assert found["two"].to_best_ci95 == pytest.approx((2.0, 2.0))
    assert found["one"].to_best_ci95 == pytest.approx((1.0, 1.0))
    low, high = found["one"].rmse_ci95_deg
    assert high / low > 1.2
    assert (found["one"].rank, found["one"].rank_ci95) == (1, (1, 1))
    assert (found["two"].rank, found["two"].rank_ci95) == (2, (2, 2))


@pytest.mark.parametrize("trainings", [1, 6])
def test_methods_of_one_law_are_distinguished_rarely(trainings, monkeypatch):
    """The interval of two that are equal excludes 1 in 5 % of the cases, with few records in some more."""
    monkeypatch.setattr(ranking, "RESAMPLES", 200)
    apart, count = 0, 40
    for seed in range(count):
        random, both = rng(seed), {}
        for name in "ab":
            of_training = random.lognormal(0.0, 0.3 * (trainings > 1), size=(trainings, 1, 1, 1))
            both[name] = shared(seed) * of_training * random.lognormal(0.0, 0.3, size=(trainings, C, R, S))
        (worse,) = [of for of in rank_methods(both, (), rng(seed)) if of.rank == 2]
        apart += worse.to_best_ci95[0] > 1
    assert apart <= 0.2 * count


def test_oracles_and_ensembles_are_no_first():
    common = shared()
    squares = {"Truth": 0.01 * common, "Ensemble": 0.25 * common, "AM": common, "RAM": 4 * common}
    found = named(rank_methods(squares, ("Truth",), rng()))
    assert [found[name].rank for name in squares] == [None, None, 1, 2]
    assert found["Ensemble"].to_best_ci95 == pytest.approx((0.5, 0.5))
    assert not competes("Truth", oracle=True)
    assert not competes("Ensemble")
    assert competes("a filter of somebody")


def test_one_run_says_nothing_of_how_sure_it_is():
    (of,) = rank_methods({"one": np.ones((1, 1, 1, 1))}, (), rng())
    assert (of.rank, of.rmse_ci95_deg, of.rank_ci95, of.to_best_ci95) == (1, None, None, None)
    assert of.noise_to_best_ci95 == (None,)


def test_methods_on_other_runs_are_refused():
    with pytest.raises(ValueError, match="must be compared on the same ones"):
        rank_methods({"one": shared(), "two": shared()[:, :, :4]}, (), rng())


def test_rankings_come_back_from_a_file():
    rankings = [Ranking(0.1, (-1.0, 1.0), "nominal", tuple(rank_methods({"one": shared()}, (), rng())))]
    (found,) = rankings_of({"ranks": json.loads(json.dumps([of.to_dict() for of in rankings]))})
    (of,) = found.ranked
    assert of == dataclasses.replace(rankings[0].ranked[0], noise_to_best_ci95=())
    assert rankings_of({}) == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rank": 0}, r"ranks\[0\]\.ranked\[0\]\.rank: .*greater than or equal to 1"),
        ({"rmse_deg": -1.0}, "greater than 0"),
        ({"to_best_ci95": [1.0, math.inf]}, "ranks"),
        ({"method": "x" * 300}, "at most 200"),
    ],
)
def test_damaged_rankings_are_refused_in_one_line(changes, said):
    ranking = Ranking(0.1, (-1.0, 1.0), "nominal", tuple(rank_methods({"one": shared()}, (), rng())))
    stated = ranking.to_dict()
    stated["ranked"][0] |= changes
    with pytest.raises(InputError, match=said) as error:
        rankings_of({"ranks": [stated]})
    assert "\n" not in str(error.value)


def test_over_groups_a_method_is_measured_against_one_of_them_in_pairs():
    """Twice its RMSE on one group and eight times on another is four times it, whichever runs are drawn."""
    groups = [{"ours": shared(seed), "other": factor**2 * shared(seed)} for seed, factor in ((1, 2), (2, 8))]
    found = times_reference(groups, "ours", rng())
    assert found["ours"] == (1.0, (1.0, 1.0))
    ratio, interval = found["other"]
    assert (ratio, *interval) == pytest.approx((4.0, 4.0, 4.0))
