"""The method table: a new estimator is one declaration, and is then in every table, figure and command."""

import ast
import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import rl
import scripts
import scripts.train
import twin
from twin.estimation import registry
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import (
    MethodSpec,
    Style,
    Training,
    find_method,
    find_training,
    method_specs,
    proposed_method,
    register_method,
    trainings,
)
from twin.evaluation.compare import evaluate
from twin.evaluation.method import build_method
from twin.evaluation.protocol import Protocol
from twin.evaluation.record import EvaluationRecord
from twin.hysteresis import ColemanHodgdon
from twin.report.figures import rmse_figure, style_of
from twin.report.tables import ordered, paper_table

TOY = MethodSpec(
    name="Toy filter",
    rank=31.5,
    family="filter",
    told="R",
    build=lambda known: ActiveModel(known.reference, known.sample_time),
    models=(ColemanHodgdon.name,),
    training=Training("toy", "toy.onnx", lambda path: pytest.fail("never loaded"), "a toy"),
    trained_as=None,
    in_paper_suite=True,
    style=Style("#123456", "-", "8"),
)


@pytest.fixture
def own_table(monkeypatch):
    """A copy of the table, which a test may add to."""
    method_specs()
    monkeypatch.setattr(registry, "_SPECS", dict(registry._SPECS))


def test_every_method_has_a_name_and_a_place_of_its_own():
    specs = method_specs()
    assert len({spec.name for spec in specs}) == len({spec.rank for spec in specs}) == len(specs) >= 27
    assert proposed_method().name == "RAM"
    assert [spec.name for spec in specs if spec.is_limit] == ["Ensemble (limit)"]
    assert sorted(spec.paper_column for spec in specs if spec.paper_column is not None) == [0, 1, 2, 3]
    assert set(trainings()) >= {"ram", "direct", "lstm", "gru", "kalman-net"}


def test_a_toy_estimator_is_found_in_help_tables_figures_and_suites(own_table, capsys, records, model):
    toy = register_method(TOY)

    with pytest.raises(SystemExit):
        scripts.train.main(["--help"])
    assert "toy: a toy" in re.sub(r"[\s│]+", " ", capsys.readouterr().out)

    toy = dataclasses.replace(toy, training=None)  # it needs no trained file to run
    known = Knowledge(0.1, {ColemanHodgdon.name: model})
    pull, bend = records[0]
    record = EvaluationRecord(pull, bend, np.ones(len(bend), bool), (2.0, 4.0), "nominal", "0")
    methods = [build_method(spec, known) for spec in (toy, find_method("AM"))]
    scores, *_ = evaluate([record], methods, Protocol("paper-only", seeds=2))
    header = paper_table(scores, "gaussian").splitlines()[0]
    assert re.split(r"\s{2,}", header.strip()) == ["noise", "index", "AM", "Toy filter"]
    assert style_of("Toy filter") == TOY.style
    labels = [text.get_text() for text in rmse_figure(scores).legends[0].get_texts()]
    assert labels[:2] == ["AM", "Toy filter"]
    assert ordered(["RAM", "Toy filter", "AM"]) == ["AM", "Toy filter", "RAM"]
    assert TOY in [spec for spec in method_specs() if spec.in_paper_suite]


def test_a_name_or_an_agent_is_given_once(own_table):
    with pytest.raises(ValueError, match="'AM' is registered already"):
        register_method(dataclasses.replace(TOY, name="AM"))
    ram = Training("ram", "x.onnx", lambda path: pytest.fail("never loaded"), "")
    with pytest.raises(ValueError, match="agent 'ram' of 'Toy filter' is registered already"):
        register_method(dataclasses.replace(TOY, training=ram))


def test_what_is_unknown_is_refused_with_the_valid_names():
    with pytest.raises(ValueError, match=r"unknown method 'AN'; valid: C-H, C-H \(monotone\), Bouc-Wen"):
        find_method("AN")
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


def test_no_method_is_spelled_outside_its_own_file():
    """Names and agents as words of the code: a string that is one, or that a flag is made of."""
    specs = method_specs()
    words = {spec.name for spec in specs} | set(trainings())
    homes = {word: _home(word) for word in words}
    spelled = []
    for package in (twin, rl, scripts):
        for path in Path(package.__file__).parent.rglob("*.py"):
            for line, text in _strings(path):
                for word in words:
                    exact = text == word or f"--agent {word}" in text or f"/{word}/" in text
                    if exact and path not in homes[word]:
                        spelled.append(f"{path}:{line}: {text!r}")
    # Names of models of hysteresis and of ONNX operators are not names of methods.
    allowed = ("recurrent_graph.py", "graph_check.py")
    assert not [line for line in spelled if not line.split(":")[0].endswith(allowed)]


def _home(word: str) -> set[Path]:
    """The files of `twin/estimation` that register a method with this word."""
    folder = Path(registry.__file__).parent
    found = {path for path in folder.rglob("*.py") if f'"{word}"' in path.read_text()}
    found.discard(folder / "learned" / "graph_check.py")  # operators of ONNX
    assert len(found) == 1, (word, found)
    return found


def _strings(path: Path) -> list[tuple[int, str]]:
    """Line and text of every string of a file that is no docstring."""
    tree = ast.parse(path.read_text())
    documents = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    return [
        (node.lineno, node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documents
    ]
