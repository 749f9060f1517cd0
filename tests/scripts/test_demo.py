"""The whole pipeline as `make demo` runs it: a short run, and the real one with the figures it must reach."""

import json
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from repository import endotwin
from typed import done

import scripts.demo

PAPER_NOISES = [("gaussian", 1.0), ("gaussian", 5.0), ("poisson", 0.1), ("poisson", 1.0), ("poisson", 2.0)]
LONGEST = 7200  # [s] of the real demo: a run that hangs ends, a slow machine is no fault


class Demo(NamedTuple):
    """Results of one run of the demo."""

    out: Path
    summary: dict
    episodes: int
    """Of PPO."""

    @property
    def rmse(self) -> dict[tuple[str, float, str], float]:
        """By noise, level and method [deg]."""
        rows = json.loads((self.out / "results/evaluation.json").read_text())["rows"]
        return {(row["noise"], row["level"], row["method"]): row["rmse_deg"] for row in rows}


@pytest.fixture(scope="module")
def short(tmp_path_factory, few_steps) -> Demo:
    """Few episodes and short records, its commands one after the other in this process."""

    def in_turn(commands: Sequence[str]) -> None:
        for command in commands:
            done(command, tmp_path_factory.getbasetemp())

    out = tmp_path_factory.mktemp("short demo") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scripts.demo, "_run_side_by_side", in_turn)
        flags = "--records 2 --seconds 8 --episodes 32 --seeds 2 --json"
        printed = done(f"demo --out {shlex.quote(str(out))} {flags}", out.parent)
    return Demo(out, json.loads(printed), 32)


@pytest.fixture(scope="module")
def real(tmp_path_factory) -> Demo:
    """As `make demo` runs it, in processes of its own."""
    out = tmp_path_factory.mktemp("real demo") / "out"
    ended = endotwin("demo", "--out", out, "--json", cwd=out.parent, timeout=LONGEST)
    assert ended.returncode == 0, ended.stderr[-3000:]
    return Demo(out, json.loads(ended.stdout), 2000)


@pytest.fixture(params=["short", pytest.param("real", marks=pytest.mark.slow)])
def demo(request) -> Demo:
    return request.getfixturevalue(request.param)


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "level"), PAPER_NOISES)
@pytest.mark.parametrize("rival", ["C-H", "AM"])
def test_ram_beats_the_model_and_the_active_model_under_every_noise_of_the_paper(real, noise, level, rival):
    assert real.rmse[noise, level, "RAM"] < real.rmse[noise, level, rival]


@pytest.mark.slow
def test_ram_beats_direct_rl_in_experiment_1(real):
    assert real.rmse["gaussian", 1.0, "RAM"] < real.rmse["gaussian", 1.0, "Direct RL"]


@pytest.mark.slow
def test_the_oracle_is_better_than_what_can_be_deployed(real):
    """It sees the truth: were it not better, the truth would not reach it, or would reach the others."""
    for noise, level in PAPER_NOISES:
        assert real.rmse[noise, level, "RAM (oracle)"] < real.rmse[noise, level, "RAM"]


def test_every_method_of_the_paper_has_a_figure_under_every_noise(demo):
    for noise, level in PAPER_NOISES:
        for method in ("C-H", "AM", "LSTM", "Direct RL", "RAM", "RAM (oracle)"):
            assert 0 < demo.rmse[noise, level, method] < 180


def test_training_is_the_papers(demo):
    text = (demo.out / "runs/ram/config.yaml").read_text()
    for line in (
        f"episodes: {demo.episodes}",
        "learning_rate: 0.00025",
        "horizon: 1024",
        "discount: 0.99",
        "minibatch: 128",
    ):
        assert line in text
    for line in ("clip: 0.2", "noise_level: 0.1", "sample_time: 0.1"):
        assert line in text


def test_demo_ends_with_one_self_contained_page(demo):
    assert Path(demo.summary["out"]) == demo.out / "report.html"
    page = (demo.out / "report.html").read_text()
    links = re.findall(r'(?:src|href)="([^"#][^"]*)"', page)
    assert links
    assert all(link.startswith("data:") for link in links)
    for part in ("Table II", "Table III", "Fig. 5", "Fig. 10", "endotwin train", "video/mp4"):
        assert part in page
    assert "This run has no" not in page
    assert "cannot be shown" not in page


def test_every_command_of_the_demo_is_stated_in_order(demo):
    facts = json.loads((demo.out / "demo.json").read_text())
    verbs = [command.split()[1] for command in facts["commands"]]
    assert list(dict.fromkeys(verbs)) == ["generate", "identify", "render", "train", "evaluate"]
    assert f"--episodes {demo.episodes} " in " ".join(facts["commands"])


def test_a_stage_that_fails_ends_the_demo_with_its_command():
    with pytest.raises(ValueError, match="`endotwin nothing` ended with exit code 2"):
        scripts.demo._run_side_by_side(["nothing", "--help"])
