import json

import briefly
import numpy as np
import pytest
from scores import simulated_record

from twin.estimation.knowledge import Knowledge
from twin.estimation.open_loop import MONOTONE
from twin.estimation.registry import method_specs, needed_fits
from twin.evaluation.compare import compare
from twin.evaluation.fitting import MODEL_NAMES, identify_models, in_single_precision, load_fits
from twin.evaluation.method import build_method
from twin.evaluation.protocol import Protocol
from twin.hysteresis import ColemanHodgdon


def usual_specs():
    """Methods that no twins need be simulated for."""
    return [spec for spec in method_specs() if not spec.presentation.on_request]


@pytest.fixture(scope="module")
def records(records):
    """The first ten seconds of each."""
    return [(pull[:100], bend[:100]) for pull, bend in records]


@pytest.fixture(scope="module", autouse=True)
def short_search():
    """Fewer generations of a model, fewer evaluations of a filter's likelihood."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.tune_filters(patch)
        patch.setattr("twin.evaluation.fitting.GENERATIONS", 40)
        yield


@pytest.fixture(scope="module")
def models(records, tmp_path_factory):
    return identify_models(records, tmp_path_factory.mktemp("models"), seed=0)


@pytest.fixture(scope="module")
def known(models, records):
    """All that methods without a network may know, with every fit found."""
    known = Knowledge(0.1, models, records, smallest_wire_offset=1.2e-3)
    fits = {fit.key: fit.find(known) for fit in needed_fits(usual_specs())}
    return Knowledge(0.1, models, records, fits=fits, smallest_wire_offset=1.2e-3)


def test_every_model_is_identified_once_and_kept(models, records, tmp_path):
    assert tuple(models) == MODEL_NAMES
    assert models[MONOTONE].monotone()
    assert not models[ColemanHodgdon.name].monotone()
    first = identify_models(records, tmp_path, seed=0)
    stamps = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert identify_models(records, tmp_path, seed=0) == first == models
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == stamps


def test_models_and_fits_lose_the_digits_that_depend_on_the_processor(models):
    """A half stays a half: loops at the limit of the monotone model stay monotone."""
    one, other = ({"a": 0.7375860698 * of, "b": [22.4037773836 * of, 3], "c": "x"} for of in (1, 1 + 2e-13))
    assert in_single_precision(one) == in_single_precision(other)
    b = in_single_precision(22.4037773836)
    assert in_single_precision(22.4037773836 / 2) == b / 2 == pytest.approx(22.4037773836 / 2, rel=1e-7)
    model = models[ColemanHodgdon.name]
    assert model.a_per_mm == float(np.float32(model.a_per_mm))


@pytest.mark.slow
def test_fits_come_back_from_their_file(known, tmp_path):
    (tmp_path / "tuned.json").write_text(json.dumps(dict(known.fits)))
    assert load_fits(tmp_path / "tuned.json") == known.fits
    assert load_fits(tmp_path / "none.json") == {}


@pytest.mark.parametrize("content", ["no json", "[]", '{"coleman-hodgdon": 1}'])
def test_a_damaged_file_is_named(content, tmp_path):
    path = tmp_path / "tuned.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"tuned\.json is damaged: remove it"):
        load_fits(path)


@pytest.mark.slow
def test_tuned_filters_beat_the_papers_on_the_training_stroke(known, records):
    pull, bend = records[0]
    record = simulated_record(pull, bend, source="training")
    methods = [build_method(spec, known) for spec in usual_specs() if spec.is_ready(known)]
    scores, *_ = compare([record], methods, Protocol("paper-only", seeds=4))
    rmse = {score.method: score.rmse_deg for score in scores if score.condition == ("gaussian", 1.0)}
    assert len(rmse) == 20
    for name in ("AM-tuned", "AM-tuned (Q, R)", "Constant gain", "ESMF", "Koopman"):
        assert rmse[name] < 0.7 * rmse["AM"], name
    assert rmse["KF"] == pytest.approx(rmse["AM"], rel=1e-9)
    assert rmse["UKF"] == pytest.approx(rmse["AM"], rel=1e-9)
