"""Offsets and delays of measured logs, fitted with a model and no part of it."""

import numpy as np
import pytest
from identifying import parameters_of

from twin.episode import Record
from twin.hysteresis import BoucWen, ColemanHodgdon, PrandtlIshlinskii
from twin.identification import identify
from twin.identification.nuisances import (
    Log,
    Nuisances,
    determines_delay,
    fit_nuisances,
    records_of,
    rmse_from,
)

TIME = np.arange(240) * 0.05
DELAY = 0.13
BOUC_WEN = BoucWen(12.0, -14.0, 0.5, 1.2, 1.6)
MODELS = [ColemanHodgdon(0.4, 12.0, 7.0), pytest.param(BOUC_WEN, marks=pytest.mark.slow)]
PLAYS = PrandtlIshlinskii((3.0, 2.0, 4.0), (0.0, 0.4, 1.1))


def pull_at(time, scale):
    return scale * (2 * np.sin(time) + np.sin(2.3 * time + 1))


def recorded(pull, bend):
    return Record(TIME, pull, measured_deg=bend)


def measured(model, offsets, delay=DELAY):
    """Logs whose angle follows the command of a while ago, each counted from a zero of its own."""
    logs = []
    for place, offset in enumerate(offsets):
        scale = 1 + 0.5 * place
        late = pull_at(np.maximum(TIME - delay, 0), scale)
        bend = model.response(late, 5.0) + offset
        record = recorded(pull_at(TIME, scale), bend)
        logs.append(Log(record, ((0, len(TIME)),), has_offset=True, has_delay=delay > 0))
    return logs


def rough(model, logs):
    """The model as it is identified without nuisances."""
    records = records_of(logs, Nuisances((0.0,) * len(logs)), 0.05)
    return identify(records, 1, model.name, population=30, generations=15)[0]


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_offsets_a_delay_and_the_model_are_found_together(model):
    logs = measured(model, (7.0, -4.0))
    found, rmse, nuisances = fit_nuisances(rough(model, logs), logs, 0.05)
    assert rmse < 0.1
    np.testing.assert_allclose(nuisances.offsets_deg, [7, -4], atol=0.25)
    assert nuisances.delay_s == pytest.approx(DELAY, abs=0.005)
    along = pull_at(TIME, 1.2)
    error = found.response(along, 0.0) - model.response(along, 0.0)
    assert np.sqrt(np.mean(error**2)) < 0.25
    assert all(isinstance(value, float) for value in parameters_of(found).tolist())


def test_only_what_a_log_has_is_fitted():
    model = MODELS[0]
    logs = measured(model, (7.0, 0.0), delay=0.0)
    logs[1] = Log(logs[1].record, logs[1].pieces)
    _, rmse, nuisances = fit_nuisances(rough(model, logs), logs, 0.05)
    assert rmse < 1e-3
    assert nuisances.offsets_deg == (pytest.approx(7, abs=1e-2), 0.0)
    assert nuisances.delay_s == 0.0


def test_constraint_of_monotone_loops_holds_with_nuisances():
    model = ColemanHodgdon(0.4, 12.0, 3.0)
    logs = measured(model, (7.0,))
    free, _, _ = fit_nuisances(rough(model, logs), logs, 0.05)
    held, _, _ = fit_nuisances(rough(model, logs), logs, 0.05, monotone=True)
    assert not free.monotone()
    assert held.monotone()


def test_plays_have_a_delay_and_no_zero_of_the_angle():
    logs = measured(PLAYS, (7.0, -4.0))
    found, rmse, nuisances = fit_nuisances(PLAYS, logs, 0.05, thresholds_mm=PLAYS.thresholds_mm)
    assert nuisances.offsets_deg == (0.0, 0.0)
    assert nuisances.delay_s == pytest.approx(DELAY, abs=0.005)
    assert rmse < 0.1
    np.testing.assert_allclose(found.weights_deg_per_mm, PLAYS.weights_deg_per_mm, atol=0.1)
    still = measured(PLAYS, (7.0,), delay=0.0)
    assert fit_nuisances(PLAYS, still, 0.05)[2] == Nuisances((0.0,))


def test_prediction_is_scored_from_its_first_sample_on_and_begins_before():
    model = MODELS[0]
    (log,) = measured(model, (7.0,))
    bend = log.record.measured_deg.copy()
    bend[180:] += 2.0
    nuisances = Nuisances((7.0,), DELAY)
    disturbed = Log(recorded(log.record.pull_mm, bend), ((0, 100), (110, 240)), has_delay=True)
    assert rmse_from(model, [disturbed], [180], nuisances, 0.05) == pytest.approx(2, abs=0.05)
    assert rmse_from(model, [disturbed], [120], nuisances, 0.05) == pytest.approx(np.sqrt(2), abs=0.05)
    with pytest.raises(ValueError, match="no measurement is left to predict"):
        rmse_from(model, [disturbed], [240], nuisances, 0.05)


def test_a_command_of_one_speed_tells_no_delay():
    triangle = 3 * np.abs((TIME / 4) % 2 - 1)
    assert not determines_delay(triangle)
    assert not determines_delay(np.repeat(triangle, 3))  # it stands between its moves
    assert not determines_delay(np.zeros(9))
    assert determines_delay(np.sin(TIME))
