"""The Bouc-Wen model against its differential equation, its limits, and far outside of saturation."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from twin.hysteresis import BoucWen, ColemanHodgdon, load_model

MODEL = BoucWen(22.0, -12.0, 1.7, 0.9, 1.5)
models = st.builds(
    BoucWen,
    st.floats(1, 50),
    st.floats(2, 40).flatmap(lambda size: st.sampled_from([size, -size])),
    st.floats(0.1, 10),
    st.floats(0.5, 4),
    st.one_of(st.just(1.0), st.floats(1, 6)),
)
pulls = st.floats(-5, 5)
increments = st.floats(-2, 2)
internals = st.floats(-12, 12)
paths = st.lists(pulls, min_size=3, max_size=20).map(np.array)


def pull_of(time):
    """Two unequal reversals per cycle: the loops have minor loops [mm]."""
    return 3 + np.sin(time) + 0.6 * np.sin(3 * time + 0.4)


def rate_of_w(w, speed, model):
    """The equation as printed, by its own signs and not by the direction of motion."""
    rho, sigma, n = model.rho_per_mm, model.sigma, model.n
    size = abs(w)
    return rho * (speed - sigma * abs(speed) * size ** (n - 1) * w + (sigma - 1) * speed * size**n)


def angle(model: BoucWen, w, pull):
    return np.asarray(model.kappa_x_deg_per_mm * pull + model.kappa_w_deg * w)


def stepped(model: BoucWen, w, increment, pull=0.0):
    """w after one step of the model, which knows only the angle."""
    before = angle(model, w, pull)
    after, _ = model.step(before, model.start(pull), pull + increment, pull)
    return (after - model.kappa_x_deg_per_mm * (pull + increment)) / model.kappa_w_deg


@pytest.mark.parametrize(
    "model", [MODEL, BoucWen(20.0, 9.0, 3.0, 0.6, 2.5), BoucWen(20.0, -9.0, 2.0, 2.0, 1.0)]
)
def test_response_solves_the_differential_equation_to_first_order(model):
    times = np.linspace(0, 10, 101)

    def rate(time, w):
        return rate_of_w(w[0], np.cos(time) + 1.8 * np.cos(3 * time + 0.4), model)

    w = solve_ivp(rate, (0, 10), [0.4], t_eval=times, rtol=1e-9, atol=1e-9, max_step=0.01).y[0]
    exact = angle(model, w, pull_of(times))
    errors = []
    for refine in (50, 100):
        fine = np.linspace(0, 10, 100 * refine + 1)
        errors.append(np.abs(model.response(pull_of(fine), exact[0])[::refine] - exact).max())
    assert errors[1] < 0.003 * abs(model.kappa_w_deg)
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.05)  # Euler: half the step, half the error


@given(model=models, w=internals, increment=increments)
def test_step_solves_the_implicit_equation_as_a_bracketing_solver_does(model, w, increment):
    """Backward Euler of the printed equation, its root found by Brent's method."""

    def residual(after):
        return after - w - rate_of_w(after, increment, model)

    edge = abs(w) + 1 + 2 * model.rho_per_mm * abs(increment)
    root = brentq(residual, -edge, edge, xtol=1e-13, rtol=1e-13)
    assert stepped(model, w, increment) == pytest.approx(
        root, abs=1e-9 * edge * (1 + 50 / abs(model.kappa_w_deg))
    )


@given(model=models, pair=st.tuples(internals, internals), increment=increments)
def test_two_angles_keep_their_order_and_come_no_further_apart(model, pair, increment):
    low, high = sorted(pair)
    gap = stepped(model, high, increment) - stepped(model, low, increment)
    assert -1e-9 <= gap <= (high - low) + 1e-9


@given(model=models, w=st.floats(-6, 6), increment=increments, pull=pulls)
def test_slope_is_the_derivative_of_the_step(model, w, increment, pull):
    ahead = 1.0 if increment >= 0 else -1.0
    if min(abs(w), abs(w * ahead + model.rho_per_mm * abs(increment))) < 1e-2:
        w += 0.05  # with n = 1 the derivative jumps where w changes sign
    bend, nudge = angle(model, w, pull), 1e-5 * abs(model.kappa_w_deg)
    after = [model.step(bend + way * nudge, model.start(pull), pull + increment, pull)[0] for way in (1, -1)]
    slope = model.slope(bend, pull + increment, pull)
    assert 0 < slope <= 1
    assert slope == pytest.approx((after[0] - after[1]) / (2 * nudge), abs=1e-4)


@given(path=paths, bend0=st.floats(-100, 100), model=models)
def test_single_steps_equal_the_whole_response(path, bend0, model):
    bend, memory = [np.array(bend0)], model.start(path[0])
    for k in range(1, len(path)):
        now, memory = model.step(bend[-1], memory, path[k], path[k - 1])
        bend.append(now)
    response = model.response(path, bend0)
    np.testing.assert_allclose(response, bend, rtol=1e-7, atol=1e-7 * np.abs(response).max())


def test_large_loop_saturates_and_leaves_saturation_at_two_sigma_rho():
    there = np.linspace(-12, 12, 4801)
    bend = MODEL.response(np.concatenate([there, there[::-1], [-12 + 1e-6]]), angle(MODEL, 0.0, -12.0))
    rising, falling = bend[:4801], bend[4801:]
    assert rising[-1] - 22.0 * 12.0 == pytest.approx(-12.0, abs=1e-4)
    assert falling[-2] + 22.0 * 12.0 == pytest.approx(12.0, abs=1e-4)
    after_reversal = (falling[-1] - falling[-2]) / 1e-6
    assert after_reversal == pytest.approx(22.0 - 12.0 * 2 * 0.9 * 1.7, rel=1e-4)


def test_coleman_and_hodgdon_is_the_case_n_1_sigma_1():
    a, b, c = 1.15, 22.38, 5.0
    same = BoucWen(b, (c - b) / a, a, 1.0, 1.0)
    pull = pull_of(np.linspace(0, 10, 20001))
    other = ColemanHodgdon(a, b, c).response(pull, 40.0)
    np.testing.assert_allclose(same.response(pull, 40.0), other, atol=4e-3 * np.ptp(other))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"n": 0.9}, "n at least 1"),
        ({"sigma": 0.4}, "sigma at least 0.5"),
        ({"rho_per_mm": 0.0}, "kappa_x and rho positive"),
        ({"kappa_w_deg": 0.0}, "kappa_w not zero"),
        ({"kappa_x_deg_per_mm": -3.0}, "kappa_x and rho positive"),
        ({"n": 1e300}, "must be finite"),
        ({"sigma": "wide"}, "sigma is 'wide', no number"),
        ({"rho_per_mm": None}, "rho_per_mm is None, no number"),
    ],
)
def test_file_that_is_no_such_model_is_refused(tmp_path, change, fault):
    path = tmp_path / "bouc_wen.json"
    path.write_text(json.dumps({"model": "bouc-wen", **MODEL.to_dict(), **change}))
    with pytest.raises(ValueError, match=r"bouc_wen\.json is no Bouc-Wen model") as refused:
        load_model(path)
    assert fault in str(refused.value)
