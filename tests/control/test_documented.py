"""docs/control.md: every controller has its row, and its way of adding one is the whole way."""

import concurrent.futures
import re
from pathlib import Path

import pytest

from twin.control import registry
from twin.control.comparison import compare
from twin.control.condition import find_conditions
from twin.control.controllers.ppo import load_tracking_policy
from twin.control.settings import ControlSettings
from twin.preset import load_preset, load_ranges

DOCUMENT = (Path(__file__).resolve().parents[2] / "docs/control.md").read_text()


def test_every_controller_has_its_row():
    first = {line.split("|")[1].strip(" `") for line in DOCUMENT.splitlines() if line.startswith("| `")}
    assert {spec.name for spec in registry.controller_specs()} <= first


def test_the_documented_training_writes_what_the_controller_runs(tmp_path, monkeypatch):
    _, code = re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL)
    assert "TrackingTraining(seed=1)" in code
    short = code.replace(
        "TrackingTraining(", "TrackingTraining(samples=64, horizon=32, environments=2, minibatch=32, "
    )
    monkeypatch.chdir(tmp_path)
    exec(compile(short, "docs/control.md", "exec"), {"__name__": "documented"})
    assert "--tracking-policy runs/ppo.onnx" in DOCUMENT
    assert load_tracking_policy(tmp_path / "runs/ppo.onnx").sample_time == 0.02


@pytest.fixture
def documented():
    """The controller of the document, registered as it stands there."""
    code, _ = re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL)
    exec(compile(code, "docs/control.md", "exec"), {"__name__": "documented"})
    yield "bang"
    registry._SPECS.pop("bang")


def test_a_controller_by_the_documented_way_is_tuned_and_scored(documented, tmp_path):
    settings = ControlSettings(
        load_preset("ureteroscope"),
        load_ranges("ureteroscope"),
        strokes_mm=((-1.0, 1.0),),
        twins=2,
        seconds=4,
        physics="reduced",
        candidates=4,
    )
    with concurrent.futures.ThreadPoolExecutor(1) as here:
        found = compare(settings, find_conditions("short"), [documented], tmp_path, here, lambda *_: None)
    (result,) = found.results
    assert result.controller == documented
    (searched,) = found.tuned
    assert searched["tried"] == 4
    assert 0.001 <= searched["settings"]["step_mm"] <= 0.1
    assert (abs(found.shown[documented].pull_mm) <= 3.0).all()
