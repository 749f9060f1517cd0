"""The method table: a new estimator is one declaration, and is then in every table, figure and command."""

import dataclasses
import re
from pathlib import Path

import pytest
from scores import simulated_record

import scripts.train
from twin.estimation import registry
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.methods import METHODS, Presentation, Style
from twin.estimation.registry import (
    MethodSpec,
    Training,
    find_method,
    find_training,
    method_specs,
    proposed_method,
    register_method,
    trainings,
)
from twin.evaluation.compare import compare
from twin.evaluation.method import build_method
from twin.evaluation.protocol import Protocol
from twin.hysteresis import ColemanHodgdon
from twin.report.figures import noise_figure, style_of
from twin.report.tables import ordered, paper_table

TOY = MethodSpec(
    name="Toy filter",
    build=lambda known: ActiveModel(known.reference, known.sample_time),
    given=("R",),
    models=(ColemanHodgdon.name,),
    training=Training("toy", "toy.onnx", lambda path: pytest.fail("never loaded"), "a toy"),
)


@pytest.fixture
def own_table(monkeypatch):
    """A copy of the table, which a test may add to."""
    method_specs()
    monkeypatch.setattr(registry, "_SPECS", dict(registry._SPECS))
    monkeypatch.setitem(METHODS, TOY.name, Presentation("filter", True, style=Style("#123456", "-")))


def test_every_method_has_one_row_of_the_table():
    specs = method_specs()
    assert [spec.name for spec in specs] == list(METHODS)
    assert proposed_method().name == "RAM"
    assert [spec.name for spec in specs if spec.presentation.is_limit] == ["Ensemble (limit)"]
    assert all(set(spec.given) <= set(registry.GIVEN) for spec in specs)
    columns = [row.paper_column for row in METHODS.values() if row.paper_column is not None]
    assert sorted(columns) == [0, 1, 2, 3]
    assert set(trainings()) >= {"ram", "direct", "lstm", "gru", "kalman-net"}


def test_a_toy_estimator_is_found_in_help_tables_figures_and_suites(own_table, capsys, records, model):
    toy = register_method(TOY)

    assert scripts.train.main(["--help"]) == 0
    assert "toy: a toy" in " ".join(capsys.readouterr().out.split())

    toy = dataclasses.replace(toy, training=None)  # it needs no trained file to run
    known = Knowledge(0.1, {ColemanHodgdon.name: model})
    pull, bend = records[0]
    record = simulated_record(pull, bend)
    methods = [build_method(spec, known) for spec in (toy, find_method("AM"))]
    scores, *_ = compare([record], methods, Protocol("paper-only", seeds=2))
    header = paper_table(scores, "gaussian").splitlines()[0]
    assert re.split(r"\s{2,}", header.strip()) == ["noise", "index", "AM", "Toy filter"]
    assert style_of("Toy filter").colour == "#123456"
    labels = {text.get_text() for text in noise_figure(scores).axes[0].get_yticklabels()}
    assert labels == {"AM", "Toy filter"}
    assert ordered(["RAM", "Toy filter", "AM"]) == ["AM", "RAM", "Toy filter"]


def test_a_name_or_an_agent_is_given_once(own_table):
    with pytest.raises(ValueError, match="'AM' is registered already"):
        register_method(dataclasses.replace(TOY, name="AM"))
    ram = Training("ram", "x.onnx", lambda path: pytest.fail("never loaded"), "")
    with pytest.raises(ValueError, match="agent 'ram' of 'Toy filter' is registered already"):
        register_method(dataclasses.replace(TOY, training=ram))


def test_what_is_unknown_is_refused_with_the_valid_names():
    with pytest.raises(ValueError, match=r"unknown method 'AN'; valid: C-H, C-H \(monotone\), Bouc-Wen"):
        find_method("AN")
    with pytest.raises(ValueError, match=r"unknown method 'AM-tuend' \(did you mean 'AM-tuned'\?\); valid"):
        find_method("AM-tuend")
    with pytest.raises(ValueError, match=f"unknown agent 'dqn'; valid: {', '.join(trainings())}"):
        find_training("dqn")


def test_a_method_waits_for_what_it_needs(model, records):
    nothing = Knowledge(0.1, {})
    assert not [spec.name for spec in method_specs() if spec.is_ready(nothing)]
    only_model = Knowledge(0.1, {ColemanHodgdon.name: model})
    ready = [spec.name for spec in method_specs() if spec.is_ready(only_model)]
    assert {"C-H", "AM", "KF", "UKF"} <= set(ready)
    assert not {"RAM", "AM-tuned", "Bouc-Wen", "Ensemble"} & set(ready)
    trained = dataclasses.replace(only_model, trained={"ram": (Path("x"),)}, records=records)
    ready = [spec.name for spec in method_specs() if spec.is_ready(trained)]
    assert {"RAM", "RAM (oracle)", "AM-tuned", "Constant gain", "ESMF"} < set(ready)
    assert not {"LSTM", "ESMF (geometry)", "Ensemble", "Bouc-Wen"} & set(ready)
