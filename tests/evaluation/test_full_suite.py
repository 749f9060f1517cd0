"""The full benchmark, for real and small: records, every method, its training, limit, tables, figures."""

import csv
import json
import shutil

import briefly
import numpy as np
import pytest
from distributed import LocalCluster

from scripts.evaluate import main
from twin.estimation import methods
from twin.evaluation.protocol import UNTRAINED_CONDITIONS
from twin.evaluation.ranking import rankings_of
from twin.evaluation.results import load_runs
from twin.signals.excitation import SIGNALS

pytestmark = pytest.mark.slow
METHODS = [name for name, row in methods.METHODS.items() if not row.on_request]
NOISES = 11
STATE_NONE = {
    *("C-H", "C-H (monotone)", "Bouc-Wen", "P-I", "ESMF", "ESMF (geometry)"),
    *("LSTM", "GRU", "KalmanNet", "Direct RL", "RAM", "RAM (oracle)", "Constant gain"),
    "RAM (twins), filter alone",
}
"""Methods that do not say how sure they are."""
FEW = ["--methods", "C-H", "AM", "ESMF", "Constant gain"]
SMALL = "--suite full --seconds 6 --members 12 --episodes 10 --seeds 2 --seed 1 --json"


@pytest.fixture(scope="module", autouse=True)
def small_numbers(in_one_process):
    """One randomised twin for each kind of signal, and short searches for models, filters and members."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("twin.evaluation.scenarios.RANDOMIZED", len(SIGNALS))
        patch.setattr("twin.evaluation.fitting.GENERATIONS", 40)
        briefly.tune_filters(patch)
        briefly.choose_members(patch)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Every method: for `make validate`."""
    out = tmp_path_factory.mktemp("full")
    assert main([*SMALL.split(), "--out", str(out), "--sample-time", "0.1"]) == 0
    return out


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """A few methods, none of which is trained, at two sample times."""
    out = tmp_path_factory.mktemp("few")
    assert main([*SMALL.split(), *FEW, "--out", str(out), "--sample-time", "0.1", "0.08"]) == 0
    return out


@pytest.fixture(scope="module")
def few_words(few):
    """A comparison of a few methods on three records of the same suite."""
    data = [str(few / "records" / f"record_{number:03d}.mcap") for number in range(3)]
    return [*data, *SMALL.split(), "--train", str(few / "train"), *FEW]


@pytest.fixture(scope="module")
def evaluation(folder):
    return json.loads((folder / "evaluation.json").read_text())


def test_every_method_meets_every_noise_stroke_twin_and_sample_time(evaluation):
    rows = evaluation["rows"]
    assert len(rows) == len(METHODS) * NOISES * 3 * 3
    assert list(dict.fromkeys(row["method"] for row in rows)) == METHODS
    assert {row["twin"] for row in rows} == {"nominal", "bending sheath", "randomized"}
    assert [row["method"] for row in rows if row["oracle"]] == ["RAM (oracle)"] * NOISES * 9
    for row in rows:
        assert np.isfinite([row["rmse_deg"], row["rmse_steady_deg"], *row["rmse_ci95_deg"]]).all()
        stated = [row[name] for name in ("coverage95", "width95_deg", "nees", "crps_deg")]
        assert (row["method"] not in STATE_NONE) == (None not in stated) == (stated != [None] * 4)
        assert None in stated or 0 <= row["coverage95"] <= 1
        on_a_stream = row["method"] not in ("Ensemble", "Ensemble (limit)", "Ensemble (limit, zero unknown)")
        assert (row["nis"] is None) == (None in stated or not on_a_stream)


def test_intervals_from_geometry_hold_the_truth_in_every_run_under_bounded_noise(evaluation):
    rows = [row for row in evaluation["intervals"] if row["method"] == "ESMF (geometry)"]
    assert len(rows) == 9  # strokes, twins
    assert {row["noise"] for row in rows} == {"uniform"}
    assert all(row["runs_contained"] == 1.0 for row in rows)
    assert all(0.1 < row["width_deg"] < 2 * np.sqrt(3) for row in rows)  # narrower than one measurement


def test_no_method_is_nearer_to_the_truth_than_the_limit_but_by_chance(evaluation):
    limit = {
        (r["noise"], r["level"], r["sample_time_s"], r["twin"], *r["stroke_mm"]): r["rmse_deg"]
        for r in evaluation["rows"]
        if r["method"] == "Ensemble (limit)"
    }
    ratios: dict[str, list[float]] = {}
    for r in evaluation["rows"]:
        place = (r["noise"], r["level"], r["sample_time_s"], r["twin"], *r["stroke_mm"])
        ratios.setdefault(r["method"], []).append(r["rmse_deg"] / limit[place])
    for method, found in ratios.items():
        if "oracle" not in method:
            assert np.exp(np.mean(np.log(found))) > 0.999, method


def test_ranks_and_runs_are_those_of_the_rows(folder, evaluation):
    """The first under each noise has the least RMSE, and runs give the figures of the rows again."""
    first = rankings_of(evaluation)[0]
    assert len(first.ranked) == len({row["method"] for row in evaluation["rows"]})
    racing = [of for of in first.ranked if of.rank is not None]
    assert [of.rank for of in racing] == [*range(1, len(racing) + 1)]
    runs = load_runs(folder / "runs.npz")
    assert len(runs) == len(evaluation["rows"])
    for (head, squares), row in zip(runs, evaluation["rows"], strict=True):
        assert (head.method, head.noise, head.level) == (row["method"], row["noise"], row["level"])
        assert np.sqrt(squares.mean(axis=1)).mean() == pytest.approx(row["rmse_deg"], rel=1e-5)


def test_named_methods_alone_are_compared_at_every_sample_time(few):
    rows = json.loads((few / "evaluation.json").read_text())["rows"]
    assert list(dict.fromkeys(row["method"] for row in rows)) == FEW[1:]
    assert {row["sample_time_s"] for row in rows} == {0.1, 0.08}
    assert len(rows) == len(FEW[1:]) * NOISES * 3 * 3 * 2  # strokes, kinds of twin, sample times
    assert not list(few.glob("T_0.1/*/*.onnx"))  # nothing is trained without need


def test_a_second_run_takes_what_is_there_and_says_the_same(few):
    before = json.loads((few / "evaluation.json").read_text())
    made = {path: path.stat().st_mtime_ns for path in few.glob("*/*") if path.is_file()}
    assert main([*SMALL.split(), *FEW, "--out", str(few), "--sample-time", "0.1", "--workers", "1"]) == 0
    assert {path: path.stat().st_mtime_ns for path in made} == made
    again = json.loads((few / "evaluation.json").read_text())
    slow = [row for row in before["rows"] if row["sample_time_s"] == 0.1]
    for first, second in zip(slow, again["rows"], strict=True):
        assert first["method"] == second["method"]
        assert second["rmse_deg"] == pytest.approx(first["rmse_deg"], rel=1e-6)


def test_a_policy_that_is_given_is_not_trained_and_says_the_same(folder, few_words, tmp_path):
    """One that was trained on twins serves every sample time; it needs no model in the suite `paper`."""
    out, policy = tmp_path / "out", str(folder / "ram-twins/policy.onnx")
    words = [*few_words[: few_words.index("--methods")], "--methods", "RAM (twins)", "--policy", policy]
    assert main([*words, "--out", str(out), "--sample-time", "0.1", "0.02"]) == 0
    rows = json.loads((out / "evaluation.json").read_text())["rows"]
    assert {row["method"] for row in rows} == {"RAM (twins)"}
    assert {row["sample_time_s"] for row in rows} == {0.1, 0.02}
    assert not list(out.glob("**/*.onnx"))
    paper = tmp_path / "paper"
    assert main([few_words[0], "--policy", policy, "--seeds", "2", "--out", str(paper)]) == 0
    alone = json.loads((paper / "evaluation.json").read_text())
    methods = {row["method"] for row in alone["rows"]}
    assert "RAM (twins)" in methods
    assert not methods & {"AM", "C-H", "RAM"}  # no model is known


def test_it_runs_on_a_measured_log_with_a_gap(folder, tmp_path, capsys):
    from scripts.import_log import main as import_log

    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0, 12, 500))
    time = time[(time < 5) | (time > 6)]
    pull = 1 - np.cos(2 * np.pi * time / 6)
    bend = 20 * pull - 6 * np.sign(np.sin(2 * np.pi * time / 6)) + rng.normal(0, 0.1, len(time))
    lines = [f"{t:.4f},{p:.5f},{b:.4f}" for t, p, b in zip(time, pull, bend, strict=True)]
    lines[100] = lines[100].rsplit(",", 1)[0] + ",nan"
    (tmp_path / "log.csv").write_text("\n".join(["time_s,pull_mm,angle_deg", *lines]) + "\n")
    argv = [str(tmp_path / "log.csv"), "--command-column", "pull_mm", "--out", str(tmp_path / "measured")]
    assert import_log(argv) == 0
    run = [str(tmp_path / "measured"), "--train", str(folder / "train"), "--out", str(tmp_path / "out")]
    # The records of training are the same: its models, filters and networks are taken, not made again.
    for made in ("T_0.1", "ram-memory", "ram-twins"):
        shutil.copytree(folder / made, tmp_path / "out" / made)
    assert main([*run, *SMALL.split(), "--sample-time", "0.1"]) == 0
    rows = json.loads((tmp_path / "out/evaluation.json").read_text())["rows"]
    assert {(row["twin"], *row["stroke_mm"]) for row in rows} == {("measured", 0.0, 2.0)}
    assert len(rows) == len(METHODS) * NOISES
    assert np.isfinite([row["rmse_deg"] for row in rows]).all()


def test_what_was_made_from_something_else_is_not_taken(few, capsys):
    assert main([*SMALL.replace("--seed 1", "--seed 2").split(), *FEW, "--out", str(few)]) == 2
    assert "another configuration" in capsys.readouterr().err


def test_records_are_not_trained_and_tested_on(few, tmp_path, capsys):
    train = str(few / "train")
    assert main([train, "--train", train, *SMALL.split(), "--out", str(tmp_path)]) == 2
    assert "is test data too" in capsys.readouterr().err


def test_several_trainings_are_a_row_with_their_spread(few_words, folder, tmp_path):
    words = [*few_words[: few_words.index("--methods")], "--methods", "AM", "GRU"]
    shutil.copytree(folder / "T_0.1", tmp_path / "T_0.1")  # what is trained already is taken up
    assert main([*words, "--trainings", "2", "--sample-time", "0.1", "--out", str(tmp_path)]) == 0
    evaluation = json.loads((tmp_path / "evaluation.json").read_text())
    assert evaluation["protocol"]["trainings"] == 2
    for row in evaluation["rows"]:
        assert (row["method"] == "GRU") == (len(row["training_rmse_deg"]) == 2)
    first, second = (tmp_path / "T_0.1/gru" / name for name in ("gru.onnx", "seed_2/gru.onnx"))
    assert first.read_bytes() == (folder / "T_0.1/gru/gru.onnx").read_bytes()  # the suite's seed is 1
    assert first.read_bytes() != second.read_bytes()


def test_a_cluster_gives_the_same_results(few_words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = [*few_words, "--sample-time", "0.1"]
    assert main([*words, "--out", "here", "--workers", "1"]) == 0
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster:
        assert main([*words, "--out", "there", "--dask", cluster.scheduler_address]) == 0
    here, there = (
        json.loads((tmp_path / name / "evaluation.json").read_text()) for name in ("here", "there")
    )
    assert len(here["rows"]) == (len(FEW) - 1) * NOISES * 3
    assert here["rows"] == there["rows"]
    assert here["ranks"] == there["ranks"]


def test_faulty_sensors_and_twins_that_no_training_meets_are_a_suite_of_their_own(few_words, tmp_path):
    words = SMALL.replace("--suite full", "--suite untrained").split()
    train = few_words[few_words.index("--train") + 1]
    out = tmp_path / "untrained"
    assert main([*words, "--train", train, *FEW, "--sample-time", "0.1", "--out", str(out)]) == 0
    contents = json.loads((out / "evaluation.json").read_text())
    rows = contents["rows"]
    assert contents["protocol"]["suite"] == "untrained"
    assert [(row["noise"], row["level"]) for row in rows[:: len(FEW) - 1]][:8] == [*UNTRAINED_CONDITIONS]
    assert {row["twin"] for row in rows} == {
        *("nominal", "sheath moves suddenly", "tip touched", "wider ranges", "another endoscope")
    }


def test_each_method_says_what_it_costs(folder, evaluation):
    costs = evaluation["costs"]
    assert list(costs) == METHODS
    whole = {name for name, cost in costs.items() if cost["sample_us"] is None}
    assert whole == {
        "RAM (oracle)",
        "Ensemble",
        "Ensemble (limit)",
        "Ensemble (limit, zero unknown)",
    }
    assert all(cost["sample_us"] > 0 for name, cost in costs.items() if name not in whole)
    assert costs["RAM (twins)"]["sample_us"] > costs["C-H"]["sample_us"]
    learned = {name for name, cost in costs.items() if cost["parameters"]}
    assert {"LSTM", "RAM", "RAM (oracle)"} <= learned
    assert not learned & {"C-H", "AM", "Ensemble (limit)"}
    trained = {name for name, cost in costs.items() if cost["training_s"]}
    assert trained == learned
    with (folder / "costs.csv").open() as file:
        lines = {line["method"]: line for line in csv.DictReader(file)}
    assert list(lines) == METHODS
    assert int(lines["LSTM"]["parameters"]) == costs["LSTM"]["parameters"]
    assert lines["C-H"]["training_s"] == ""
