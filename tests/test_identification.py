"""Identification: known parameters come back, an independent optimiser agrees, bad records are refused."""

import itertools

import numpy as np
import pytest
from scipy.optimize import differential_evolution

from twin.hysteresis import ColemanHodgdon
from twin.identification import LOWER, NEVER_REVERSES, UPPER, identify, mean_square_error

PAPER = (1.15, 22.38, 5.0)
OTHER = (0.4, 35.0, 21.0)
TIME = np.arange(300) * 0.1  # [s]


def records_of(parameters, noise_deg: float = 0.0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Two strokes, by a loop over eq. 4 independent of the module. Noise spares the first sample."""
    a, b, c = parameters
    rng = np.random.default_rng(8)
    records = []
    for amplitude, period in ((1.0, 10.0), (0.5, 7.0)):
        pull = 3 + amplitude * np.sin(2 * np.pi * TIME / period)
        bend = [60.0]
        for before, now in itertools.pairwise(pull):
            bend.append(bend[-1] + a * abs(now - before) * (b * now - bend[-1]) + c * (now - before))
        noise = noise_deg * rng.standard_normal(len(pull))
        noise[0] = 0
        records.append((pull, np.array(bend) + noise))
    return records


def parameters_of(model: ColemanHodgdon) -> np.ndarray:
    return np.array([model.a_per_mm, model.b_deg_per_mm, model.c_deg_per_mm])


@pytest.mark.parametrize("known", [PAPER, OTHER])
def test_genetic_algorithm_recovers_known_parameters(known):
    model, rmse = identify(records_of(known), seed=1)
    np.testing.assert_allclose(parameters_of(model), known, rtol=0.01)
    assert rmse < 0.05


def test_differential_evolution_finds_the_same_optimum_with_noise():
    records = records_of(PAPER, noise_deg=1.0)

    def cost(candidates: np.ndarray) -> np.ndarray:
        """Sum of squares of each column of (3, S) candidates, with its own forward simulation."""
        a, b, c = candidates
        total = np.zeros(candidates.shape[1:])
        for pull, measured in records:
            bend = np.full(candidates.shape[1:], measured[0])
            for k in range(1, len(pull)):
                move = pull[k] - pull[k - 1]
                bend = bend + a * abs(move) * (b * pull[k] - bend) + c * move
                total += (bend - measured[k]) ** 2
        return total

    other = differential_evolution(
        cost, list(zip(LOWER, UPPER, strict=True)), rng=0, vectorized=True, updating="deferred", maxiter=150
    )
    model, rmse = identify(records, seed=2)
    np.testing.assert_allclose(parameters_of(model), other.x, rtol=0.01)
    np.testing.assert_allclose(parameters_of(model), PAPER, rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(other.fun / (2 * len(TIME))), rel=1e-3)
    assert rmse == pytest.approx(1.0, abs=4 / np.sqrt(2 * 2 * len(TIME)))  # four standard errors


def test_mean_square_error_pools_the_samples_of_unequal_records():
    records = records_of(PAPER)
    records[1] = tuple(values[:100] for values in records[1])
    (_, one), (_, two) = records
    shifted = [(records[0][0], one + 1), (records[1][0], two + 1)]  # the first sample moves along
    model = ColemanHodgdon(np.array([1.15, 2.0]), np.array([22.38, 10.0]), np.array([5.0, 8.0]))
    expected = []
    for i in range(2):
        single = ColemanHodgdon(model.a_per_mm[i], model.b_deg_per_mm[i], model.c_deg_per_mm[i])
        errors = [single.response(pull, bend[0]) - bend for pull, bend in shifted]
        expected.append(np.mean(np.concatenate(errors) ** 2))
    np.testing.assert_allclose(mean_square_error(model, shifted), expected, rtol=1e-12)
    assert mean_square_error(ColemanHodgdon(*PAPER), records) < 1e-20


def test_diverging_candidate_is_worse_than_any_other_and_finite():
    pull = np.tile([0.0, 4.0], 2000)
    error = mean_square_error(ColemanHodgdon(np.array([6.0, 0.1]), 20.0, 5.0), [(pull, pull)])
    assert np.isfinite(error).all()
    assert error[0] > error[1]


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
    told = []
    records = records_of(PAPER, noise_deg=0.5)

    def fit(seed, on_generation=None):
        return identify(records, seed, population=20, generations=15, on_generation=on_generation)

    model, rmse = fit(5, lambda generation, best: told.append((generation, best)))
    assert fit(5) == (model, rmse)
    assert fit(6) != (model, rmse)
    generations, best = zip(*told, strict=True)
    assert generations == tuple(range(1, 16))
    assert (np.diff(best) <= 0).all()
    assert best[0] > best[-1] == rmse


def test_records_that_cannot_identify_a_loop_are_refused():
    moving, bend = records_of(PAPER)[0]
    rising = np.linspace(2, 4, 50)
    with_gap = bend.copy()
    with_gap[7] = np.nan
    for records, rule in (
        ([], "no record"),
        ([(rising, 20 * rising)], "never reverses"),
        ([(rising, 20 * rising), (rising[::-1], 20 * rising)], "never reverses"),
        ([(np.full(50, 3.0), np.full(50, 60.0))], "record 0: the command never moves"),
        ([(moving, bend), (moving, with_gap)], "record 1: command and angle must be finite"),
        ([(np.where(TIME > 3, np.inf, moving), bend)], "record 0: command and angle must be finite"),
    ):
        with pytest.raises(ValueError, match=rule):
            identify(records, seed=0)
    assert "reversal" in NEVER_REVERSES
