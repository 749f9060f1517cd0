"""Ranks by a paired jackknife: on methods whose errors are known, and whose intervals can be counted."""

import dataclasses
import json
import math

import numpy as np
import pytest

from twin.errors import InputError
from twin.estimation.registry import method_specs
from twin.evaluation.ranking import Ranking, competes, holm, rank_methods, rankings_of, times_reference

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
    found = named(rank_methods({"one": common, "two": 4 * common}))
    assert found["two"].to_best_ci95 == pytest.approx((2.0, 2.0))
    assert found["one"].to_best_ci95 == pytest.approx((1.0, 1.0))
    low, high = found["one"].rmse_ci95_deg
    assert high / low > 1.2
    assert (found["one"].rank, found["one"].rank_ci95) == (1, (1, 1))
    assert (found["two"].rank, found["two"].rank_ci95) == (2, (2, 2))


def drawn(random, trainings, records, methods, noises=2):
    """Square errors of equal methods, (K, C, R, S); records, trainings and draws differ."""
    draws, spread = 20, random.lognormal
    of_all = spread(0, 0.6, (1, 1, records, 1)) * spread(0, 0.2, (1, noises, records, draws))
    return {
        name: of_all
        * spread(0, 0.3, (1, 1, records, 1))
        * spread(0, 0.15, (1, noises, records, 1))
        * spread(0, 0.2 * (trainings > 1), (trainings, noises, 1, 1))
        * spread(0, 0.2, (trainings, noises, records, draws))
        for name in map(str, range(methods))
    }


@pytest.mark.parametrize(("trainings", "records"), [(1, 5), (5, 5), (5, 12)])
def test_intervals_of_equal_methods_cover_one_in_95_percent(trainings, records):
    """Sizes are those of the published tables; a percentile bootstrap of five records covers 85 %."""
    random, trials = rng(trainings * records), 300
    covered = 0
    for _ in range(trials):
        _, (low, high) = times_reference([drawn(random, trainings, records, 2)], "0")["1"]
        covered += low <= 1 <= high
    assert 0.91 <= covered / trials <= 0.98  # 0.93 to 0.97, and what a count of 300 is off by


@pytest.mark.parametrize("methods", [2, 6])
def test_tables_of_equal_methods_rarely_have_a_winner(methods):
    """At most one table of five noises in 20 states a best method; ranks are less sure with five records."""
    random, trials = rng(methods), 100
    tables = [rank_methods(drawn(random, 5, 5, methods, noises=5)) for _ in range(trials)]
    winners = sum(any(any(of.noise_is_best) for of in table) for table in tables)
    ranked = sum(any(of.rank_ci95 != (1, methods) for of in table) for table in tables)
    assert winners <= 0.05 * trials + 2 * math.sqrt(0.05 * 0.95 * trials)
    assert ranked <= 0.12 * trials


def test_a_method_that_is_better_under_one_noise_alone_is_the_best_there():
    random = rng(4)
    squares = drawn(random, 5, 12, 3)
    squares["1"][:, 0] *= 0.2
    found = rank_methods(squares)
    assert [of.noise_is_best for of in found] == [(False, False), (True, False), (False, False)]


def test_statements_hold_together():
    """Holm (1979): the first that fails takes those with larger probabilities with it."""
    assert holm([0.03, 0.004, 0.02, 0.03]) == [False, True, False, False]
    assert holm([0.01, 0.04]) == [True, True]
    assert holm([]) == []


def test_oracles_and_methods_that_know_the_density_are_no_first():
    """An ensemble that knows R alone could be deployed."""
    common, limit = shared(), "Ensemble (limit)"
    squares = {"Truth": 0.01 * common, limit: 0.25 * common, "Ensemble": common, "RAM": 4 * common}
    found = named(rank_methods(squares, ("Truth",)))
    assert [found[name].rank for name in squares] == [None, None, 1, 2]
    assert found[limit].to_best_ci95 == pytest.approx((0.5, 0.5))
    assert not competes("Truth", oracle=True)
    assert competes("a filter of somebody")


def test_what_no_device_knows_is_no_rival():
    """Of all methods without the truth, those that are given the density of the noise, and no other."""
    apart = [spec.name for spec in method_specs() if not competes(spec.name, spec.oracle)]
    assert set(apart) == {spec.name for spec in method_specs() if {"law", "truth"} & set(spec.given)}
    assert {"RAM (oracle)", "Ensemble (limit)", "Particles (limit)"} < set(apart)


def test_one_run_says_nothing_of_how_sure_it_is():
    (of,) = rank_methods({"one": np.ones((1, 1, 1, 1))})
    assert (of.rank, of.rmse_ci95_deg, of.rank_ci95, of.to_best_ci95) == (1, None, None, None)
    assert (of.noise_to_best_ci95, of.noise_is_best) == ((None,), (True,))  # no other competes


def test_methods_on_other_runs_are_refused():
    with pytest.raises(ValueError, match="must be compared on the same ones"):
        rank_methods({"one": shared(), "two": shared()[:, :, :4]})


def test_rankings_come_back_from_a_file():
    rankings = [Ranking(0.1, (-1.0, 1.0), "nominal", tuple(rank_methods({"one": shared()})))]
    (found,) = rankings_of({"ranks": json.loads(json.dumps([of.to_dict() for of in rankings]))})
    (of,) = found.ranked
    assert of == dataclasses.replace(rankings[0].ranked[0], noise_to_best_ci95=(), noise_is_best=())
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
    ranking = Ranking(0.1, (-1.0, 1.0), "nominal", tuple(rank_methods({"one": shared()})))
    stated = ranking.to_dict()
    stated["ranked"][0] |= changes
    with pytest.raises(InputError, match=said) as error:
        rankings_of({"ranks": [stated]})
    assert "\n" not in str(error.value)


def test_over_groups_a_method_is_measured_against_one_of_them_in_pairs():
    """Twice its RMSE on one group and eight times on another is four times it, whichever runs are drawn."""
    groups = [{"ours": shared(seed), "other": factor**2 * shared(seed)} for seed, factor in ((1, 2), (2, 8))]
    found = times_reference(groups, "ours")
    assert found["ours"] == (1.0, (1.0, 1.0))
    ratio, interval = found["other"]
    assert (ratio, *interval) == pytest.approx((4.0, 4.0, 4.0))
