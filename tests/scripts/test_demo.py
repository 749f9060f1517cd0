"""The whole pipeline as `make demo` runs it, with full training, and the bars that its table must clear."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PAPER_NOISES = [("gaussian", 1.0), ("gaussian", 5.0), ("poisson", 0.1), ("poisson", 1.0), ("poisson", 2.0)]


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    out = tmp_path_factory.mktemp("demo") / "out"
    done = subprocess.run(
        [sys.executable, "-m", "scripts", "demo", "--out", out, "--json"],
        capture_output=True,
        text=True,
        cwd=out.parent,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    rows = json.loads((out / "results/evaluation.json").read_text())["rows"]
    rmse = {(row["noise"], row["level"], row["method"]): row["rmse_deg"] for row in rows}
    return out, rmse, json.loads(done.stdout)


@pytest.mark.parametrize(("noise", "level"), PAPER_NOISES)
@pytest.mark.parametrize("rival", ["C-H", "AM"])
def test_ram_beats_the_model_and_the_active_model_under_every_noise_of_the_paper(demo, noise, level, rival):
    _, rmse, _ = demo
    assert rmse[noise, level, "RAM"] < rmse[noise, level, rival]


def test_ram_beats_direct_rl_in_experiment_1(demo):
    _, rmse, _ = demo
    assert rmse["gaussian", 1.0, "RAM"] < rmse["gaussian", 1.0, "Direct RL"]


def test_the_oracle_is_better_than_what_can_be_deployed(demo):
    """It sees the truth: were it not better, the truth would not reach it, or would reach the others."""
    _, rmse, _ = demo
    for noise, level in PAPER_NOISES:
        assert rmse[noise, level, "RAM (oracle)"] < rmse[noise, level, "RAM"]


def test_training_is_the_papers(demo):
    out, _, _ = demo
    text = (out / "runs/ram/config.yaml").read_text()
    for line in (
        "episodes: 2000",
        "learning_rate: 0.00025",
        "horizon: 1024",
        "discount: 0.99",
        "minibatch: 128",
    ):
        assert line in text
    for line in ("clip: 0.2", "noise_level: 0.1", "sample_time: 0.1"):
        assert line in text


def test_demo_ends_with_one_self_contained_page(demo):
    out, _, summary = demo
    assert Path(summary["out"]) == out / "report.html"
    page = (out / "report.html").read_text()
    links = re.findall(r'(?:src|href)="([^"#][^"]*)"', page)
    assert links
    assert all(link.startswith("data:") for link in links)
    for part in ("Table II", "Table III", "Fig. 5", "Fig. 10", "endotwin train", "video/mp4"):
        assert part in page
    assert "This run has no" not in page
    assert "cannot be shown" not in page
