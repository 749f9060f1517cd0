"""The mean square error of a model over records."""

import numpy as np
from identifying import records_of
from models import PAPER

from twin.hysteresis import ColemanHodgdon
from twin.identification import mean_square_error


def test_mean_square_error_pools_the_samples_of_unequal_records():
    records = records_of(PAPER)
    records[1] = tuple(values[:100] for values in records[1])
    (_, one), (_, two) = records
    shifted = [(records[0][0], one + 1), (records[1][0], two + 1)]  # the first sample moves along
    candidates = np.array([[1.15, 22.38, 5.0], [2.0, 10.0, 8.0]])
    model = ColemanHodgdon(*candidates.T[..., None])
    expected = []
    for candidate in candidates:
        single = ColemanHodgdon(*candidate)
        errors = [single.response(pull, bend[0]) - bend for pull, bend in shifted]
        expected.append(np.mean(np.concatenate(errors) ** 2))
    np.testing.assert_allclose(mean_square_error(model, shifted), expected, rtol=1e-12)
    assert mean_square_error(ColemanHodgdon(*PAPER), records) < 1e-20


def test_diverging_candidate_is_worse_than_any_other_and_finite():
    pull = np.tile([0.0, 4.0], 2000)
    error = mean_square_error(ColemanHodgdon(np.array([[6.0], [0.1]]), 20.0, 5.0), [(pull, pull)])
    assert np.isfinite(error).all()
    assert error[0] > error[1]
