"""Coleman-Hodgdon: known parameters come back, and an independent optimiser agrees."""

import numpy as np
import pytest
from identifying import OTHER, SEEDS, noisy_records, parameters_of, records_of
from models import PAPER

from twin.hysteresis import ColemanHodgdon
from twin.identification import identify


@pytest.mark.parametrize("known", [PAPER, OTHER])
def test_genetic_algorithm_recovers_known_parameters(known):
    model, rmse = identify(records_of(known), seed=1)
    np.testing.assert_allclose(parameters_of(model), known, rtol=0.01)
    assert rmse < 0.05


def test_monotone_constraint_holds_and_costs_accuracy_where_the_truth_is_not_monotone():
    records = records_of(PAPER)
    free, free_rmse = identify(records, seed=1, generations=40)
    bound, bound_rmse = identify(records, seed=1, generations=40, monotone=True)
    assert not free.monotone()
    assert bound.c_deg_per_mm >= bound.b_deg_per_mm / 2
    assert bound_rmse > 2 * free_rmse
    model, _ = identify(records_of(OTHER), seed=1, monotone=True)  # the truth lies inside the constraint
    np.testing.assert_allclose(parameters_of(model), OTHER, rtol=0.01)


def test_same_seed_gives_the_same_result_and_progress_never_gets_worse():
    stated = []
    records = records_of(PAPER, noise_deg=0.5)

    def fit(seed, on_generation=None):
        return identify(records, seed, population=20, generations=15, on_generation=on_generation)

    model, rmse = fit(5, lambda generation, best: stated.append((generation, best)))
    assert fit(5) == (model, rmse)
    assert fit(6) != (model, rmse)
    generations, best = zip(*stated, strict=True)
    assert generations == tuple(range(1, 16))
    assert (np.diff(best) <= 0).all()
    assert best[0] > best[-1] == rmse


@pytest.mark.parametrize("seed", SEEDS)
def test_coleman_hodgdon_comes_back_from_noisy_signals_within_two_percent(seed):
    model, rmse = identify(noisy_records(ColemanHodgdon(*PAPER), seed), seed)
    np.testing.assert_allclose(parameters_of(model), PAPER, rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(0.1), rel=0.05)
