"""Ablation: every variant is trained as it says, and measured against the whole on the same runs."""

import dataclasses
import functools
import json

import numpy as np
import pytest
from small_twins import TINY, twins

from rl.options import TrainingOptions
from rl.twins.settings import NetworkTraining, TwinsTraining
from scripts.studies import ablation
from scripts.studies.ablation import VARIANTS, Ablation, main, run_ablation
from twin.estimation.learned import ram_twins
from twin.estimation.learned.trained_file import read_trained_file
from twin.evaluation.scenarios import scenarios, write_scenarios
from twin.workers.processes import choose_workers

SMALL = {
    name: getattr(TINY, name)
    for name in (
        *("commands", "twins", "seconds", "episode"),
        *("interval_sequences", "interval_updates"),
    )
}
SMALL_NETWORK = SMALL | {"sequences": 16, "window": 20, "updates": 8}
SMALL_TWINS = SMALL | {
    name: getattr(TINY, name)
    for name in ("members", "moving", "rank", "noise_model_sequences", "noise_model_updates")
}


def small(variant):
    """A variant whose training takes seconds."""
    size = SMALL_TWINS if variant.agent == ram_twins.AGENT else SMALL_NETWORK
    return dataclasses.replace(variant, settings=size | dict(variant.settings))


@pytest.fixture(scope="module", autouse=True)
def few_records(in_one_process):
    """The benchmark's records on one stroke, with one command."""

    def few(*of):
        return scenarios(*of)[:3]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ablation, "write_scenarios", functools.partial(write_scenarios, make=few))
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory, few_records):
    """Rows of a small ablation, and what it was run on."""
    chosen = [small(of) for of in VARIANTS if of.name in ("whole", "no-error", "filter-alone")]
    options = TrainingOptions(episodes=2000)
    run = Ablation(tmp_path_factory.mktemp("ablation"), *twins(), options, (1, 2), chosen, seconds=5.0)
    with choose_workers(2, 1) as (executor, _):
        rows = run_ablation(run, executor, lambda *_: lambda *_: None)
    return rows, run


def stated(run, name, seed=1):
    """Settings of a training, as its file tells them."""
    path = run.folder / name / f"seed_{seed}" / ram_twins.TRAINING.file
    return read_trained_file(path).description["training"]


@pytest.mark.slow
def test_each_differs_from_the_whole_in_what_it_says_and_in_nothing_else(made):
    _, run = made
    whole = stated(run, "whole")
    without = stated(run, "no-error")
    assert {key: of for key, of in without.items() if whole[key] != of} == {"with_error": False}
    assert stated(run, "whole", 2) == whole | {"seed": 2}
    assert not (run.folder / "filter-alone").exists()  # the whole's files, without their parts


@pytest.mark.slow
def test_rows_are_in_order_and_the_whole_is_one(made):
    rows, run = made
    assert [row["name"] for row in rows] == [variant.name for variant in run.variants]
    assert (rows[0]["times_whole"], rows[0]["times_whole_ci95"]) == (1.0, (1.0, 1.0))
    for row in rows:
        assert row["trainings"] == 2
        assert set(row["by_twin_deg"]) == {"nominal", "randomized", "bending sheath"}
        assert len(row["by_noise_deg"]) == 11
        low, high = row["times_whole_ci95"]
        assert low <= row["times_whole"] <= high
        over = np.exp(np.mean(np.log([of["rmse_deg"] for of in row["by_noise_deg"]])))
        whole = np.exp(np.mean(np.log([of["rmse_deg"] for of in rows[0]["by_noise_deg"]])))
        assert row["times_whole"] == pytest.approx(over / whole, rel=1e-6)
        assert (row["coverage95"] is None) == (row["name"] == "filter-alone")


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_every_variant_has_settings_that_its_training_takes(variant):
    settings = TwinsTraining() if variant.agent == ram_twins.AGENT else NetworkTraining()
    for name in variant.settings:
        assert hasattr(settings, name)
    dataclasses.replace(settings, **variant.settings)


@pytest.mark.slow
def test_the_command_writes_what_it_found(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(ablation, "VARIANTS", [small(of) for of in VARIANTS])
    short = ["--seconds", "5", "--seeds", "1", "--workers", "1"]
    assert main(["--out", str(tmp_path), "--variants", "filter-alone", *short]) == 0
    contents = json.loads((tmp_path / "ablation.json").read_text())
    assert [row["name"] for row in contents["rows"]] == ["whole", "filter-alone"]
    assert contents["origin"]["command"].startswith(
        "python -m scripts.studies.ablation --variants filter-alone"
    )
    assert "no recogniser where it runs (filter alone)" in (tmp_path / "ablation.md").read_text()
    assert (tmp_path / "ablation.png").stat().st_size > 5000
    assert "2 variants, 1 trainings each" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--variants", "no-such"], "unknown variant 'no-such'; valid: whole, no-twins"),
        (["--seeds", "0"], "--seeds 0: must be at least 1"),
        (["--draws", "0"], "--draws"),
        (["--episodes", "0"], "--episodes"),
        (["--seconds", "1"], "--seconds"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(words, message, tmp_path, capsys):
    assert main(["--out", str(tmp_path / "out"), *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not (tmp_path / "out").exists()
