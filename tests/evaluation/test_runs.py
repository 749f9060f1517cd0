"""File of the errors of single runs: what is written comes back, and what is damaged is refused."""

import dataclasses
import json

import numpy as np
import pytest
from scores import SCORE

from twin.evaluation.results import load_runs, save_runs

SQUARES = [np.full((1, 2, 3), 0.25), np.arange(1.0, 9.0).reshape(2, 2, 2)]
SCORES = [SCORE, dataclasses.replace(SCORE, method="another", noise="poisson", stroke_mm=(-1.0, 1.0))]


def test_runs_come_back_with_what_they_are_of(tmp_path):
    save_runs(tmp_path / "runs.npz", SCORES, SQUARES)
    found = load_runs(tmp_path / "runs.npz")
    for (head, squares), score, wanted in zip(found, SCORES, SQUARES, strict=True):
        assert (head.method, head.noise, head.level) == (score.method, score.noise, score.level)
        assert tuple(head.stroke_mm) == score.stroke_mm
        np.testing.assert_allclose(squares, wanted, rtol=1e-6)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"square_deg2_1": np.zeros((2, 2))}, "must be numbers by training, record and draw"),
        ({"square_deg2_1": np.full((1, 1, 1), np.nan)}, "no positive number"),
        ({"square_deg2_1": np.full((1, 1, 1), -1.0)}, "no positive number"),
        ({"heads": np.array("[]]")}, "holds no runs"),
        ({"heads": np.array(json.dumps([{"method": "x"}]))}, "heads: "),
        ({"heads": None}, "is missing"),
    ],
)
def test_what_is_damaged_is_refused_in_one_line(changes, said, tmp_path):
    path = tmp_path / "runs.npz"
    save_runs(path, SCORES, SQUARES)
    with np.load(path) as archive:
        arrays = {**archive, **changes}
    np.savez(path, **{name: of for name, of in arrays.items() if of is not None})
    with pytest.raises(ValueError, match=said) as error:
        load_runs(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
