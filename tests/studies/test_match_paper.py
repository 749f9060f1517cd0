"""The preset of an instrument that is only published, against the commands that make the same figures."""

import numpy as np
import pytest
from calibrating import TRUTH
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from plain_endoscope import PLAIN

import twin
from scripts.studies.match_paper import ROUND, URETEROSCOPE, Prior, decode, encode, match
from scripts.studies.published import Commands, Published, best_coleman_hodgdon, out_of_round, outcomes
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.hysteresis import ColemanHodgdon
from twin.identification import identify
from twin.signals.noise import draw_noise

STROKES = ((2e-3, 4e-3), (-1e-3, 1e-3))
ROW = ("gaussian", 1.0)
PRIORS = {
    "section_stiffness": Prior(TRUTH.section_stiffness, 0.5, (5e-3, 0.2)),
    "sheath_friction_floor": Prior(0.7, 0.5, (0.1, 5.0)),
    "joint_friction_taper": Prior(0.3, 0.2, (0.0, 0.8)),
}
DISTANCES = arrays(float, len(URETEROSCOPE), elements=st.floats(-20, 20))


@given(distances=DISTANCES)
def test_what_is_decoded_is_encoded_again_within_its_limits(distances):
    preset = decode(TRUTH, URETEROSCOPE, distances)
    bounds = np.array([[p.distance(limit) for limit in p.limits] for p in URETEROSCOPE.values()]).T
    np.testing.assert_allclose(encode(preset, URETEROSCOPE), np.clip(distances, *bounds), atol=1e-9)


def test_one_deviation_is_a_factor_or_where_zero_is_possible_a_step():
    assert Prior(2.0, 0.5, (1.0, 9.0)).value(1.0) == pytest.approx(2.0 * np.exp(0.5))
    assert Prior(2.0, 0.5, (0.0, 9.0)).value(1.0) == pytest.approx(2.5)


def test_models_nearest_to_their_own_records_are_themselves():
    pull = np.tile(3 + np.sin(np.linspace(0, 4 * np.pi, 120)) * np.linspace(1, 0.5, 120), (3, 2, 1))
    truth = np.array([[0.2, 40.0, 5.0], [1.0, 20.0, 5.0], [3.0, 2.0, 20.0]])
    bend = ColemanHodgdon(*truth.T[:, :, None]).response(pull, np.array([[0.0, 9.0]] * 3))
    found, rmse = best_coleman_hodgdon(pull, bend)
    np.testing.assert_allclose(found, truth, rtol=2e-3, atol=2e-2)
    assert (rmse < 1e-2).all()


@pytest.mark.slow
def test_outcome_is_what_identification_and_evaluation_find():
    commands = Commands.drawn([3, 5], strokes=STROKES, episodes=(3, 3), seconds=30.0)
    outcome = outcomes([TRUTH, TRUTH.replace(section_stiffness=0.03)], commands, [ROW])[0]
    assert outcome is not None
    episodes = twin.simulate_batch([TRUTH] * 3, list(commands.identified[1]), 0.1, physics="reduced")
    model, misfit = identify([(e.pull_mm, e.truth_deg) for e in episodes], seed=1)
    assert outcome.misfit[1] == pytest.approx(misfit, rel=1e-3)
    found = [model.a_per_mm, model.b_deg_per_mm, model.c_deg_per_mm]
    np.testing.assert_allclose(outcome.model[1], found, rtol=1e-2)
    reached = ColemanHodgdon(*outcome.model[1])
    tested = twin.simulate_batch([TRUTH] * 3, list(commands.tested[1]), 0.1, physics="reduced")
    off = [reached.response(e.pull_mm, e.truth_deg[0]) - e.truth_deg for e in tested]
    assert outcome.steady[1] == pytest.approx(np.sqrt(np.mean(np.array(off)[:, 50:] ** 2)))
    assert outcome.static[1] > outcome.steady[1]
    rng, squares = np.random.default_rng(9), []
    am = ActiveModel(reached, 0.1).with_sensor(Sensor(variance=ROW[1]))
    for e in tested * 12:
        measured = e.truth_deg + draw_noise(*ROW, e.truth_deg.shape, rng)
        estimate = am.estimate(e.pull_mm[None], measured[None], e.truth_deg[:1] + 20.0)[0]
        squares.append(((estimate - e.truth_deg)[1:] ** 2).mean())
    assert outcome.active[1, 0] == pytest.approx(np.sqrt(np.mean(squares)), rel=0.05)


@pytest.mark.slow
def test_preset_is_matched_to_the_figures_of_another_endoscope():
    commands = Commands.drawn([1, 2], strokes=STROKES, episodes=(3, 2), seconds=15.0)
    wanted = TRUTH.replace(section_stiffness=1.4 * TRUTH.section_stiffness, sheath_friction_floor=1.0)
    its = outcomes([wanted], commands, [ROW])[0]
    model, active = tuple(np.median(its.model, axis=0)), {ROW: (float(its.active.mean()), 0.15)}
    published = Published(model, active, static=(0.0, 90.0), misfit=90.0, steady=90.0)
    reports = []
    start = TRUTH.replace(sheath_friction_floor=0.7)
    preset, outcome, cost = match(
        start, PRIORS, published, commands, on_outcome=lambda *news: reports.append(news)
    )
    first, costs = reports[0][1], [news[2] for news in reports]
    off = [np.abs(np.log(np.median(o.model, axis=0) / model)).max() for o in (first, outcome)]
    assert off[1] < min(0.01, off[0] / 5)
    assert 0.8 < preset.section_stiffness / wanted.section_stiffness < 1.25
    assert costs == sorted(costs, reverse=True)
    assert cost <= costs[0]


@pytest.mark.slow
def test_limits_and_roundness_count_only_where_they_are_passed():
    commands = Commands.drawn([1], strokes=STROKES, episodes=(2, 2), seconds=10.0)
    its = outcomes([TRUTH], commands, [ROW])[0]
    model, active = tuple(its.model[0]), {ROW: (float(its.active[0, 0]), 0.15)}

    def cost(radii=(), **limits):
        values = {"static": (0.0, 90.0), "misfit": 90.0, "steady": 90.0} | limits
        return match(TRUTH, PRIORS, Published(model, active, **values), commands, radii=radii, steps=1)[2]

    least = cost()
    assert cost(misfit=float(its.misfit[0]) + 0.01) == least
    for limits in (
        {"misfit": float(its.misfit[0]) - 0.1},
        {"steady": float(its.steady[0]) - 0.1},
        {"static": (0.0, float(its.static[0]) - 0.1)},
        {"static": (float(its.static[0]) + 0.1, 90.0)},
    ):
        assert cost(**limits) > least + 1
    share = float(out_of_round([TRUTH], [2e-3])[0, 0])
    assert cost((2e-3,), round_within=share * 1.01) == least
    assert cost((2e-3,), round_within=share - 2 * ROUND) == pytest.approx(least + 4, rel=1e-3)


@pytest.mark.slow
def test_taut_wires_bring_a_circle_and_slack_ones_do_not():
    taut = PLAIN.replace(pretension=60.0, sheath_friction=0.0, sheath_friction_floor=1.0)
    shares = out_of_round([taut.without_friction(), taut, taut.replace(pretension=0.5)], [1e-3, 2e-3])
    assert (shares[0] < 1e-3).all()
    assert (shares[1] < 0.02).all()
    assert shares[2, 1] > 0.03
