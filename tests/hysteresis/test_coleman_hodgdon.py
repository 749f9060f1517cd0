"""The Coleman-Hodgdon model against the differential equation, its closed form and its limits."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import COLEMAN_HODGDON
from scipy.integrate import solve_ivp

from twin.hysteresis import BoucWen, ColemanHodgdon, IdentifiedModel, PrandtlIshlinskii, load_model

PAPER = COLEMAN_HODGDON
rates = st.floats(0.2, 4.0)
slopes = st.floats(1.0, 50.0)
paths = st.lists(st.floats(-5, 5), min_size=3, max_size=30).map(np.array)


def pull_of(time):
    """Two unequal reversals per cycle: the loops have minor loops [mm]."""
    return 3 + np.sin(time) + 0.6 * np.sin(3 * time + 0.4)


def speed_of(time):
    return np.cos(time) + 1.8 * np.cos(3 * time + 0.4)


def solution_of_equation_1(times: np.ndarray, bend0: float) -> np.ndarray:
    """d theta / dt = a |v| (b l - theta) + c v by Runge-Kutta; independent of the module."""
    a, b, c = 1.15, 22.38, 5.0

    def rate(time, bend):
        velocity = speed_of(time)
        return a * abs(velocity) * (b * pull_of(time) - bend) + c * velocity

    span = (times[0], times[-1])
    return solve_ivp(rate, span, [bend0], t_eval=times, rtol=1e-9, atol=1e-9, max_step=0.01).y[0]


def test_response_solves_the_differential_equation_to_first_order():
    times = np.linspace(0, 10, 101)
    exact = solution_of_equation_1(times, 40.0)
    errors = []
    for refine in (50, 100):
        fine = np.linspace(0, 10, 100 * refine + 1)
        errors.append(np.abs(PAPER.response(pull_of(fine), 40.0)[::refine] - exact).max())
    assert errors[1] < 0.002 * np.ptp(exact)
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.05)  # Euler: half the step, half the error


@given(
    candidates=st.lists(st.tuples(rates, slopes, slopes), min_size=1, max_size=5),
    pulls=st.lists(paths.map(lambda p: np.resize(p, 12)), min_size=1, max_size=4),
    bend0=st.floats(-100, 100),
)
def test_batch_equals_loop(candidates, pulls, bend0):
    a, b, c = (np.array(values)[:, None] for values in zip(*candidates, strict=True))
    batch = ColemanHodgdon(a, b, c).response(np.array(pulls), bend0)
    assert batch.shape == (len(candidates), len(pulls), 12)
    for i, candidate in enumerate(candidates):
        for j, pull in enumerate(pulls):
            np.testing.assert_array_equal(batch[i, j], ColemanHodgdon(*candidate).response(pull, bend0))


@given(path=paths, bend0=st.floats(-100, 100), a=rates, b=slopes, c=slopes)
def test_single_steps_equal_the_whole_response(path, bend0, a, b, c):
    model = ColemanHodgdon(a, b, c)
    bend, memory = [np.array(bend0)], model.start(path[0])
    for k in range(1, len(path)):
        now, memory = model.step(bend[-1], memory, path[k], path[k - 1])
        bend.append(now)
    response = model.response(path, bend0)
    np.testing.assert_allclose(response, bend, rtol=1e-9, atol=1e-9 * np.abs(response).max())


def test_slope_approaches_b_and_the_branches_lie_two_b_minus_c_over_a_apart():
    there = np.linspace(-15, 15, 60001)
    bend = PAPER.response(np.concatenate([there, there[::-1]]), 0.0)
    rising, falling = bend[:60001], bend[60001:][::-1]
    np.testing.assert_allclose(np.diff(rising[-1000:]) / np.diff(there[-1000:]), 22.38, rtol=1e-3)
    assert falling[30000] - rising[30000] == pytest.approx(2 * (22.38 - 5.0) / 1.15, rel=1e-3)


@given(a=rates, b=slopes, share=st.floats(0.05, 2.0).filter(lambda share: abs(share - 0.5) > 0.02))
def test_monotone_is_whether_the_bend_falls_with_the_first_release(a, b, share):
    """Just after the reversal of a long pull the slope is 2 c - b."""
    model = ColemanHodgdon(a, b, share * b)
    pull = np.linspace(-5, 5, 8001)
    released = model.response(np.append(pull, pull[-1] - 1e-4), b * pull[0] + (share * b - b) / a)
    assert (released[-1] < released[-2]) == model.monotone()
    assert (released[-1] - released[-2]) / -1e-4 == pytest.approx(2 * share * b - b, abs=0.02 * b)


EACH = (PAPER, BoucWen(22.0, -12.0, 1.7, 0.9, 1.5), PrandtlIshlinskii((8.0, 4.0, 0.0), (0.0, 0.25, 0.5)))


@pytest.mark.parametrize("model", EACH, ids=lambda model: model.name)
def test_model_file_comes_back(tmp_path, model):
    written = IdentifiedModel(model, rmse_deg=0.5, optimizer="ga", seed=3, source="data").to_dict()
    assert (written["model"], written["rmse_deg"], written["seed"]) == (model.name, 0.5, 3)
    path = tmp_path / "model.json"
    path.write_text(json.dumps(written))
    assert load_model(path) == model


def test_file_of_coleman_and_hodgdon_tells_how_far_from_monotone_it_is_and_needs_no_name(tmp_path):
    values = IdentifiedModel(PAPER, rmse_deg=0.5, optimizer="ga", seed=3, source="data").to_dict()
    assert values["c_over_b"] == pytest.approx(5.0 / 22.38)
    assert values["monotone"] is False
    del values["model"]  # as the first files were written
    path = tmp_path / "coleman_hodgdon.json"
    path.write_text(json.dumps(values))
    assert load_model(path) == PAPER


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("no json", "no model of hysteresis written by `endotwin identify`"),
        ("[1, 2, 3]", "no model of hysteresis"),
        ("null", "no model of hysteresis"),
        ('{"model": "preisach"}', "'preisach'; valid: coleman-hodgdon, bouc-wen, prandtl-ishlinskii"),
        ('{"model": ["bouc-wen"]}', "valid: coleman-hodgdon"),
        (
            "{}",
            "no Coleman-Hodgdon model: a_per_mm is missing; it needs a_per_mm, b_deg_per_mm, c_deg_per_mm",
        ),
        ('{"a_per_mm": 1.15, "b_deg_per_mm": 22.38}', "c_deg_per_mm is missing"),
        ('{"a_per_mm": "steep", "b_deg_per_mm": 22.38, "c_deg_per_mm": 5}', "a_per_mm is 'steep', no number"),
        ('{"a_per_mm": null, "b_deg_per_mm": 22.38, "c_deg_per_mm": 5}', "a_per_mm is None, no number"),
        ('{"a_per_mm": true, "b_deg_per_mm": 22.38, "c_deg_per_mm": 5}', "a_per_mm is True, no number"),
        ('{"a_per_mm": 1e300, "b_deg_per_mm": 22.38, "c_deg_per_mm": 5}', "must be finite"),
        ('{"a_per_mm": 1.15, "b_deg_per_mm": -1, "c_deg_per_mm": 5}', "the first two positive"),
    ],
)
def test_file_that_is_no_model_is_refused_by_name(tmp_path, content, fault):
    path = tmp_path / "coleman_hodgdon.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"coleman_hodgdon\.json") as refused:
        load_model(path)
    assert fault in str(refused.value)
