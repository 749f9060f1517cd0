"""An estimator of the user's own, in a file of theirs, is in every table and figure."""

import functools
import json
import re
import sys

import numpy as np
import pytest
from repository import REPOSITORY
from scores import simulated_record
from typed import typed

from scripts.command import describe_error
from twin.estimation import registry
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import find_method, load_method_files, method_specs
from twin.evaluation.compare import compare
from twin.evaluation.method import build_method
from twin.evaluation.protocol import Protocol
from twin.hysteresis import ColemanHodgdon
from twin.workers.processes import local_workers

EXAMPLE = REPOSITORY / "docs" / "examples" / "my_filter.py"
DATA = REPOSITORY / "assets" / "samples" / "dataset"
REGISTERED = (
    "from twin.estimation.registry import MethodSpec, register_method\n"
    "register_method(MethodSpec({!r}, lambda known: None, ('R',)))\n"
)


@pytest.fixture(autouse=True)
def own_table(monkeypatch):
    """Copies of the tables, which a test may add to."""
    method_specs()
    monkeypatch.setattr(registry, "_SPECS", dict(registry._SPECS))
    monkeypatch.setattr(registry, "_LOADED", {})
    for name in [name for name in sys.modules if name.startswith("method_file_")]:
        monkeypatch.delitem(sys.modules, name)  # each test runs the file itself


def test_the_example_is_in_tables_figures_and_results(tmp_path):
    model = ColemanHodgdon(1.15, 22.38, 5.0)
    (tmp_path / "model.json").write_text(json.dumps({"model": model.name, **model.to_dict()}))
    words = f"evaluate {DATA} --model model.json --suite paper-only --seeds 2 --format svg --out results"
    ended = typed(f"{words} --method-file {EXAMPLE}", tmp_path)
    assert ended.code == 0, ended.err
    results = json.loads((tmp_path / "results" / "evaluation.json").read_text())
    methods = [row["method"] for row in results["rows"]]
    assert {"AM", "Complementary"} <= {*methods}
    assert methods.count("Complementary") == methods.count("AM")
    for table in ("tables.md", "tables.tex"):
        assert "Complementary" in (tmp_path / "results" / table).read_text()
    drawn = {path.suffix for path in (tmp_path / "results").glob("rmse*")}
    assert drawn == {".svg"}
    assert str(EXAMPLE) in [of["path"] for of in results["origin"]["data"]]


def test_worker_processes_have_it_too(records, model):
    (spec,) = load_method_files([EXAMPLE])
    pull, bend = records[0]
    record = simulated_record(pull, bend)
    methods = [build_method(spec, Knowledge(0.1, {ColemanHodgdon.name: model}))]
    protocol = Protocol("paper-only", seeds=2)
    here, *_ = compare([record], methods, protocol)
    with local_workers(1, functools.partial(load_method_files, [EXAMPLE])) as executor:
        there, *_ = compare([record], methods, protocol, executor=executor)
    assert here == there


def test_a_file_runs_once(tmp_path):
    path = tmp_path / "one.py"
    path.write_text(REGISTERED.format("One"))
    assert load_method_files([path, path]) == [find_method("One")] * 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "must be an existing Python file"),
        ("x = 1\n", "registers no method"),
        ("def f(:\n", r"bad\.py, line 1: SyntaxError: "),
        ("x = 1\nraise RuntimeError('so\\nwhat')\n", r"bad\.py, line 2: RuntimeError: so$"),
        (REGISTERED.format("AM"), r"bad\.py, line 2: method 'AM' is registered already$"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(text, message, tmp_path):
    if text is not None:
        (tmp_path / "bad.py").write_text(text)
    ended = typed("evaluate --suite full --method-file bad.py --out results", tmp_path)
    assert ended.code == 2
    with pytest.raises(ValueError, match=message):
        load_method_files([tmp_path / "bad.py"])
    assert len(ended.err.splitlines()) == 1
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("former", "text", "message"),
    [
        (
            "def step(",
            "def other(",
            r"mine\.py, line 39: TypeError: Can't instantiate abstract class .* step",
        ),
        ("Complementary(known.reference)", "known.other", r"mine\.py, line 39: AttributeError: 'Knowledge' "),
        ("Complementary(known.reference)", "3", "its `build` returned 3: must be an object of a class that"),
        (
            "+ self.share",
            "+ self.shares",
            r"mine\.py, line 30: AttributeError: 'Complementary' object has no",
        ),
        ("return predicted", "return predicted[:2]", r"mine\.py, line 30: ValueError: operands could not be"),
        (
            "Complementary(known.reference)",
            "len",
            r"^a fault of the method file .*mine\.py, or of EndoTwin: TypeError",
        ),
    ],
)
def test_an_incomplete_method_is_no_fault_of_the_program(tmp_path, model, former, text, message):
    path = tmp_path / "mine.py"
    path.write_text(EXAMPLE.read_text().replace(former, text, 1))
    (spec,) = load_method_files([path])
    pull, bend = np.linspace(0, 1, 20), np.linspace(0, 30, 20)

    def compared():
        method = build_method(spec, Knowledge(0.1, {ColemanHodgdon.name: model}))
        compare([simulated_record(pull, bend)], [method], Protocol("paper-only", seeds=1))

    with pytest.raises((AttributeError, TypeError, ValueError)) as caught:
        compared()
    assert re.search(message, describe_error(caught.value))
