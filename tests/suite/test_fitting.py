import briefly
import numpy as np
import pytest

from twin.evaluation.compare import evaluate
from twin.evaluation.method import as_method
from twin.evaluation.protocol import Protocol
from twin.evaluation.record import EvaluationRecord
from twin.hysteresis import ColemanHodgdon
from twin.suite.fitting import (
    MODEL_NAMES,
    MONOTONE,
    TUNED_WITH,
    Fits,
    best_gain,
    identify_models,
    koopman_variances,
    load_fits,
    save_fits,
    tune,
)
from twin.suite.methods import active_methods, set_filters, static_methods, tuned_methods


@pytest.fixture(scope="module")
def records(records):
    """The first ten seconds of each."""
    return [(pull[:100], bend[:100]) for pull, bend in records]


@pytest.fixture(scope="module", autouse=True)
def short_search():
    """Fewer generations of a model, fewer evaluations of a filter's likelihood."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.tune_filters(patch)
        patch.setattr("twin.suite.fitting.GENERATIONS", 40)
        yield


@pytest.fixture(scope="module")
def models(records, tmp_path_factory):
    return identify_models(records, tmp_path_factory.mktemp("models"), seed=0)


@pytest.fixture(scope="module")
def fits(models, records):
    return Fits(
        models,
        {name: tune(name, models, records, 0.1, 0) for name in TUNED_WITH},
        best_gain(models, records, 0.1, 0),
        koopman_variances(records, 0),
    )


def test_every_model_is_identified_once_and_kept(models, records, tmp_path):
    assert tuple(models) == MODEL_NAMES
    assert models[MONOTONE].monotone()
    assert not models[ColemanHodgdon.name].monotone()
    first = identify_models(records, tmp_path, seed=0)
    stamps = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert identify_models(records, tmp_path, seed=0) == first == models
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == stamps


def test_fits_come_back_from_their_file(fits, tmp_path):
    save_fits(tmp_path / "tuned.json", fits)
    assert load_fits(tmp_path / "tuned.json", fits.models) == fits


@pytest.mark.parametrize(
    "content", ["no json", "[]", '{"tuned": {}}', '{"tuned": {"AM": {}}, "gain": [0, 0], "koopman": [1, 1]}']
)
def test_a_damaged_file_is_named(content, tmp_path):
    path = tmp_path / "tuned.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"tuned\.json is damaged: remove it"):
        load_fits(path, {})


def test_tuned_filters_beat_the_papers_on_the_training_stroke(fits, records):
    pull, bend = records[0]
    record = EvaluationRecord(pull, bend, np.ones(len(bend), bool), (2.0, 4.0), "training", "0")
    sets = [as_method(*named) for named in set_filters(fits, records, 0.1, 1.2e-3).items()]
    methods = [*static_methods(fits), *active_methods(fits, 0.1), *sets, *tuned_methods(fits, records, 0.1)]
    rows, _ = evaluate([record], methods, Protocol("paper-only", seeds=4))
    rmse = {
        row["method"]: row["rmse_deg"] for row in rows if (row["noise"], row["level"]) == ("gaussian", 1.0)
    }
    assert len(rmse) == 19
    for name in ("AM-tuned", "AM-tuned (Q, R)", "Constant gain", "ESMF", "Koopman"):
        assert rmse[name] < 0.7 * rmse["AM"], name
    assert rmse["KF"] == pytest.approx(rmse["AM"], rel=1e-9)
    assert rmse["UKF"] == pytest.approx(rmse["AM"], rel=1e-9)


def test_fitted_noise_is_near_that_of_training(fits):
    assert fits.tuned["AM (Q, R)"].measurement_variance == pytest.approx(0.1, rel=0.5)
    assert fits.tuned["AM"].measurement_variance == 0.1  # told, not tuned
