"""`endotwin gate`: a verdict as exit status, page and gate.json; a mistake is one line and leaves nothing."""

import json
import os
from pathlib import Path

import pytest
from briefly import tune_filters
from gated import SMALL, export_small, logs_on
from small_twins import twins
from typed import typed

from twin.gate import gather, run_gate
from twin.recording import write_episode

RELEASED = "ENDOTWIN_RELEASED_POLICY"
"""Variable that may name a fully trained RAM (twins) of the preset ureteroscope."""


@pytest.mark.slow
def test_a_no_go_is_exit_status_1_a_page_and_reasons(tmp_path, monkeypatch):
    tune_filters(monkeypatch)
    monkeypatch.setattr("twin.gate.QUICK", SMALL)
    export_small(tmp_path / "policy.onnx")
    (log,) = logs_on(twins()[0], (-2.0, 3.0), count=1)
    write_episode(tmp_path / "log.mcap", log)
    line = "gate policy.onnx log.mcap --preset ureteroscope --quick --out out/gate.html --json"
    code, out, said = typed(line, tmp_path)
    assert code == 1, said
    summary = json.loads(out)
    assert summary["verdict"] == "no-go"
    written = json.loads((tmp_path / "out/gate.json").read_text())
    assert written["verdict"] == "no-go"
    assert written["reasons"] == summary["reasons"]
    assert written["subject"]["logs"][0]["name"] == "log_0"
    page = (tmp_path / "out/gate.html").read_text()
    assert "This was a quick run" in page
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"gate.html", "gate.json"}


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("gate nothing.onnx", "no trained file"),
        ("gate text.onnx", "is not a trained file"),
        ("gate text.onnx --preset uretroscope", "did you mean 'ureteroscope'"),
        ("gate text.onnx --out gate.pdf", "must end in .html"),
        ("gate text.onnx nowhere", "nowhere"),
    ],
)
def test_a_mistake_is_exit_status_2_and_leaves_nothing(tmp_path, line, fault):
    (tmp_path / "text.onnx").write_text("nothing")
    code, _, said = typed(line, tmp_path)
    assert code == 2
    assert fault in said
    assert len(said.strip().splitlines()) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"text.onnx"}


@pytest.mark.slow
@pytest.mark.skipif(RELEASED not in os.environ, reason=f"{RELEASED} names no trained file")
def test_go_for_the_released_policy():
    preset, ranges = twins()
    logs = logs_on(preset, (-2.0, 3.0), seconds=30.0)
    verdict = run_gate(gather(Path(os.environ[RELEASED]), preset, ranges, logs))
    assert verdict.word == "go", verdict.reasons
