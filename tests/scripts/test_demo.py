"""The pipeline as `make demo` runs it: the real one with the figures that it must reach, and its settings."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from browser import WIDTHS, open_browser
from gated import logs_on
from repository import endotwin

import scripts.demo
from twin.gate import gather, run_gate
from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges

PAPER_NOISES = [("gaussian", 1.0), ("gaussian", 5.0), ("poisson", 0.1), ("poisson", 1.0), ("poisson", 2.0)]
DOUBTS = "accuracy|cover|NEES|NIS|worth|hostile|error under faults|latency"  # after a tenth of a training
LONGEST = 7200  # [s] of the real demo: a run that hangs ends, a slow machine is no fault


class Demo(NamedTuple):
    """Results of one run of the demo."""

    out: Path
    summary: dict

    @property
    def rmse(self) -> dict[tuple[str, float, str], float]:
        """By noise, level and method [deg]."""
        rows = json.loads((self.out / "results/evaluation.json").read_text())["rows"]
        return {(row["noise"], row["level"], row["method"]): row["rmse_deg"] for row in rows}


@pytest.fixture(scope="module")
def real(tmp_path_factory) -> Demo:
    """As `make demo` runs it, in processes of its own."""
    out = tmp_path_factory.mktemp("real demo") / "out"
    ended = endotwin("demo", "--out", out, "--json", cwd=out.parent, timeout=LONGEST)
    assert ended.returncode == 0, ended.stderr[-3000:]
    return Demo(out, json.loads(ended.stdout))


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "level"), PAPER_NOISES)
@pytest.mark.parametrize("rival", ["C-H", "AM"])
def test_ram_beats_the_model_and_the_active_model_under_every_noise_of_the_paper(real, noise, level, rival):
    assert real.rmse[noise, level, "RAM"] < real.rmse[noise, level, rival]


@pytest.mark.slow
def test_methods_of_one_run_are_in_their_order(real):
    """Physics inside beat the paper's RAM, and the oracle, which sees the truth, what can be deployed."""
    assert real.rmse["gaussian", 1.0, "RAM"] < real.rmse["gaussian", 1.0, "Direct RL"]
    for noise, level in PAPER_NOISES:
        assert real.rmse[noise, level, "RAM (twins)"] < real.rmse[noise, level, "RAM"]
        assert real.rmse[noise, level, "RAM (oracle)"] < real.rmse[noise, level, "RAM"]


@pytest.mark.slow
def test_every_method_of_the_paper_has_a_figure_under_every_noise(real):
    for noise, level in PAPER_NOISES:
        for method in ("C-H", "AM", "LSTM", "Direct RL", "RAM", "RAM (oracle)", "RAM (twins)"):
            assert 0 < real.rmse[noise, level, method] < 180


@pytest.mark.slow
def test_training_is_the_papers(real):
    text = (real.out / "runs/ram/config.yaml").read_text()
    lines = "episodes: 2000|learning_rate: 0.00025|horizon: 1024|discount: 0.99|minibatch: 128|clip: 0.2"
    for line in (*lines.split("|"), "noise_level: 0.1", "sample_time: 0.1"):
        assert line in text


@pytest.mark.slow
def test_demo_ends_with_one_self_contained_page(real):
    assert Path(real.summary["out"]) == real.out / "report.html"
    page = (real.out / "report.html").read_text()
    links = re.findall(r'(?:src|href)="([^"#][^"]*)"', page)
    assert links
    assert all(link.startswith("data:") for link in links)
    for part in ("Table II", "Table III", "endotwin train", "video/mp4"):
        assert part in page
    with open_browser() as browser:
        found = [fault for width in WIDTHS for fault in browser.faults(real.out / "report.html", width)]
    assert found == []


@pytest.mark.slow
def test_the_gate_allows_what_is_safe_and_names_what_the_short_training_lacks(real):
    policy = real.out / "runs/ram-twins/policy.onnx"
    preset, ranges = load_preset("ureteroscope"), load_ranges("ureteroscope")
    verdict = run_gate(gather(policy, preset, ranges, logs_on(preset, (-2.0, 3.0), seconds=30.0)))
    failed = {check.name for check in verdict.checks if check.required and not check.holds}
    assert not {name for name in failed if not re.search(DOUBTS, name)}, verdict.reasons


def test_a_stage_that_fails_ends_the_demo_with_its_command():
    with pytest.raises(ValueError, match="`endotwin nothing` ended with exit code 2"):
        scripts.demo._run_side_by_side(["nothing", "--help"])


SMALL = ["--records", "1", "--seconds", "2", "--episodes", "1", "--seeds", "1"]


@pytest.fixture
def stopped_demo(tmp_path, monkeypatch) -> Path:
    """A demo that was stopped after its first commands, and what the user put next to their results."""

    def stop(commands: Sequence[str]) -> None:
        (tmp_path / "out" / "data").mkdir()
        (tmp_path / "out" / "data" / "mine.txt").write_text("mine")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(scripts.demo, "_run_side_by_side", stop)
        assert scripts.demo.main(["--out", str(tmp_path / "out"), *SMALL]) == 130
    return tmp_path / "out"


def files(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "changed", [["--seed", "2"], ["--seeds", "3"], ["--records", "0"], ["--seconds", "nan"]]
)
def test_nothing_of_another_demo_is_removed(stopped_demo, capsys, changed):
    before = files(stopped_demo)
    assert scripts.demo.main(["--out", str(stopped_demo), *SMALL, *changed]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert files(stopped_demo) == before


def test_a_folder_that_no_demo_made_is_refused(tmp_path, capsys):
    for name in ("results", "demo.json"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mine.txt").write_text("mine")
        assert scripts.demo.main(["--out", str(tmp_path), *SMALL]) == 2
        assert f"holds {name}, which no demo made: choose another folder" in capsys.readouterr().err
        assert len(files(tmp_path)) == 1
        (tmp_path / name / "mine.txt").unlink()
        (tmp_path / name).rmdir()


def test_a_demo_of_the_same_settings_goes_on(stopped_demo, monkeypatch):
    run = []
    monkeypatch.setattr(scripts.demo, "_run_side_by_side", run.append)
    assert scripts.demo.main(["--out", str(stopped_demo), *SMALL]) == 0
    assert [line.split()[0] for group in run for line in group if line][:2] == ["generate", "generate"]
    verbs = [line.split()[0] for group in run for line in group]
    assert list(dict.fromkeys(verbs)) == ["generate", "identify", "render", "train", "evaluate", "report"]
    assert (stopped_demo / "data" / "mine.txt").read_text() == "mine"
