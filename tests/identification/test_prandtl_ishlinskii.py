"""Prandtl-Ishlinskii: known weights come back, and another solver of least squares agrees."""

import numpy as np
import pytest
from identifying import SEEDS, noisy_records
from models import PAPER
from scipy.optimize import lsq_linear

from twin.hysteresis import ColemanHodgdon, PrandtlIshlinskii
from twin.hysteresis.prandtl_ishlinskii import plays_along
from twin.identification import identify


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("stroke", "thresholds"), [((2.0, 4.0), (0.0, 0.25, 0.5, 0.75)), ((-8.0, 8.0), ())])
def test_prandtl_ishlinskii_comes_back_from_noisy_signals_within_two_percent(seed, stroke, thresholds):
    """Neighbouring plays differ little: eight thresholds inside 2 mm would need hundreds of records."""
    truth = PrandtlIshlinskii((7.0, 5.0, 6.0, 5.0), thresholds)
    if not thresholds:  # those that are spread over the stroke: eight, up to half of it
        truth = PrandtlIshlinskii((5.0, 3.0, 4.0, 3.0, 3.0, 4.0, 3.0, 4.0), tuple(map(float, range(8))))
    records = noisy_records(truth, seed, stroke, each=6)
    model, rmse = identify(records, 0, "prandtl-ishlinskii", thresholds_mm=thresholds)
    np.testing.assert_allclose(model.thresholds_mm, truth.thresholds_mm, atol=2e-3)
    np.testing.assert_allclose(model.weights_deg_per_mm, truth.weights_deg_per_mm, rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(0.2), rel=0.15)  # the noise, and that of the first angles


def test_weights_are_those_of_another_solver_with_the_level_of_each_record_free():
    records = [
        (pull, bend + 9 * i) for i, (pull, bend) in enumerate(noisy_records(ColemanHodgdon(*PAPER), 5))
    ]
    thresholds = (0.0, 0.1, 0.2, 0.4, 0.8)
    model, _ = identify(records, 0, "prandtl-ishlinskii", thresholds_mm=thresholds)
    design = np.concatenate([plays_along(pull, thresholds).T for pull, _ in records])
    levels = np.kron(np.eye(len(records)), np.ones((600, 1)))
    lower = np.repeat([0.0, -np.inf], [len(thresholds), len(records)])
    other = lsq_linear(
        np.hstack([design, levels]), np.concatenate([bend for _, bend in records]), (lower, np.inf), tol=1e-12
    ).x[: len(thresholds)]
    assert 0.0 in model.weights_deg_per_mm  # the bound is at work here
    np.testing.assert_allclose(model.weights_deg_per_mm, other, atol=1e-5)
