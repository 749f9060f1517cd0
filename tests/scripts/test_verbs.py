"""The commands as a user types them: short real runs, and mistakes."""

import dataclasses
import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from documented import options_of
from repository import REPOSITORY, endotwin
from typed import done, typed
from workspace import EVALUATE, POLICIES

from scripts.__main__ import VERBS
from twin.measured.folder import write_measured
from twin.measured.log import read_measured_log
from twin.preset.file import load_preset
from twin.recording import read_dataset, read_episode


def test_every_verb_writes_what_its_summary_names(workspace, summaries):
    for line, summary in summaries.items():
        assert (workspace / summary["out"]).exists(), line
    assert json.loads((workspace / "coleman_hodgdon.json").read_text())["a_per_mm"] > 0
    assert load_preset(workspace / "fitted.yaml").section_stiffness > 0
    assert not [path for path in workspace.rglob(".*") if path.is_file() and path.name != ".endotwin"]
    page = (workspace / "report.html").read_text()
    assert "Table II" in page
    assert "This run has no" not in page.replace("This run has no demo.json", "")


def test_evaluation_has_a_row_of_every_method_and_noise(workspace):
    evaluation = json.loads((workspace / "results/evaluation.json").read_text())
    methods = {row["method"] for row in evaluation["rows"]}
    assert methods >= {"C-H", "AM", "LSTM", "Direct RL", "RAM", "AM-tuned", "Constant gain", "RAM (oracle)"}
    assert len(evaluation["rows"]) == 8 * len(methods)
    assert {row["oracle"] for row in evaluation["rows"] if "oracle" in row["method"]} == {True}
    assert evaluation["protocol"]["sample_time_s"] == 0.1


@pytest.mark.slow
def test_same_seed_same_table_in_another_process(workspace, tmp_path):
    line = f"{EVALUATE} --policy runs/ram/policy.onnx --suite paper-only --methods C-H AM RAM"
    done(f"{line} --out {tmp_path}/one", workspace)
    assert endotwin(*line.split(), "--out", tmp_path / "two", cwd=workspace).returncode == 0
    first, second = ((tmp_path / name / "evaluation.json").read_bytes() for name in ("one", "two"))
    assert first == second


@pytest.mark.slow
def test_a_method_that_is_not_given_is_trained_and_kept_with_the_results(workspace, tmp_path):
    line = (
        f"{EVALUATE} {POLICIES} --train data/train --suite paper-only --episodes 16 --out {tmp_path}/results"
    )
    line = line.replace("runs/direct/policy.onnx ", "") + " --methods C-H RAM LSTM 'Direct RL'"
    done(line, workspace)
    assert (tmp_path / "results/direct/policy.onnx").is_file()
    assert not (tmp_path / "results/ram").exists()


@pytest.mark.slow
def test_generate_changes_draws_and_moves_what_is_given(tmp_path):
    line = (
        "generate --episodes 2 --seconds 2 --stroke -1 1 --randomize --sheath-bend-deg 0 "
        "--sheath-bend-to-deg 90 --sensor-variance 0 --set encoder_counts=400 sensor_resolution=0.01 "
        "--out out"
    )
    done(line, tmp_path)
    first, second = read_dataset(tmp_path / "out")
    presets = [episode.metadata["preset"] for episode in (first, second)]
    assert presets[0]["wire_stiffness"] != presets[1]["wire_stiffness"]
    assert {preset["encoder_counts"] for preset in presets} == {400}
    assert {preset["sheath_bend"] for preset in presets} == {0.0}  # what is set is not drawn over
    assert np.degrees(first.sheath_bend[[0, -1]]) == pytest.approx([0, 90])
    steps = first.measured_bend / 0.01
    assert np.abs(steps - np.round(steps)).max() < 1e-6


def test_a_script_runs_by_its_path_too(tmp_path):
    words = [sys.executable, REPOSITORY / "scripts" / "generate.py", "--help"]
    ended = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path)
    assert ended.returncode == 0
    assert "--sheath-bend-deg" in ended.stdout


def test_a_given_command_is_followed_at_another_bend_of_the_sheath(tmp_path):
    (tmp_path / "c.csv").write_text("time_s,pull_mm\n0,0\n3,1\n6,-1\n")
    line = "generate --preset ureteroscope --command-csv c.csv --sheath-bend-deg 90 --format csv --out out"
    done(line, tmp_path)
    header, *rows = (tmp_path / "out/episode_0000.csv").read_text().splitlines()
    assert header == "time_s,pull_mm,bend_deg,command_deg,tension_a_n,tension_b_n"
    assert len(rows) == 300
    assert json.loads((tmp_path / "out/dataset.json").read_text())["recipe"]["sheath_bends_deg"] == [[90, 90]]
    preset = read_episode(tmp_path / "out/episode_0000.mcap").metadata["preset"]
    assert preset["sheath_bend"] == pytest.approx(1.5708, abs=1e-4)


def test_a_measured_log_becomes_records_like_the_simulated_ones(tmp_path):
    phase = np.repeat(np.arange(0, 4 * np.pi, 0.1), 2)
    rows = np.column_stack([phase, 60 * np.sin(phase), 30 * np.sin(phase - 0.2)]).tolist()
    lines = ["phase_rad,command_deg,angle_deg", *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "loop.csv").write_text("\n".join(lines))
    line = "import loop.csv --command-column command_deg --angle-column angle_deg --out data/measured --json"
    code, out, err = typed(line, tmp_path)
    assert (code, err) == (0, "")
    summary = json.loads(out)
    assert summary["samples"] == len(phase) / 2
    assert sorted(path.name for path in (tmp_path / "data/measured").iterdir()) == [
        "dataset.json",
        "loop.mcap",
    ]
    line = (
        f"identify data/measured --sample-time {summary['sample_time_s']} --generations 20 --out model.json"
    )
    done(line, tmp_path)
    assert json.loads((tmp_path / "model.json").read_text())["rmse_deg"] < 10


def test_a_mistake_is_the_exit_code_of_the_process_too(tmp_path):
    ended = endotwin("generate", "--preset", "ureterscope", "--out", "x", cwd=tmp_path)
    said = "endotwin generate: unknown preset 'ureterscope' (did you mean 'ureteroscope'?)"
    assert ended.returncode == 2
    assert ended.stderr.startswith(said)
    assert len(ended.stderr.splitlines()) == 1
    assert not any(tmp_path.iterdir())


@pytest.fixture(scope="module")
def mistakes(workspace, tmp_path_factory):
    """A copy of the workspace, with files in it that are no good."""
    folder = tmp_path_factory.mktemp("mistakes") / "work"
    shutil.copytree(workspace, folder)
    whole = next((folder / "data/train").glob("*.mcap")).read_bytes()
    (folder / "cut").mkdir(exist_ok=True)
    (folder / "cut/episode.mcap").write_bytes(whole[: len(whole) // 2])
    (folder / "table.mcap").write_text("time_s,pull_mm\n0,1\n")
    (folder / "nan.csv").write_text("time_s,pull_mm\n0,0\n1,nan\n2,0\n")
    (folder / "log.csv").write_text("time_s,command_deg,angle_deg\n0,0,0\n1,60,30\n2,0,9\n")
    (folder / "negative.yaml").write_text("wire_stiffness: -5.0\n")
    (folder / "bare.yaml").write_text("pretension: 2.0\n")
    (folder / "model.json").write_text("{}")
    model = json.loads((folder / "coleman_hodgdon.json").read_text())
    (folder / "absurd.json").write_text(json.dumps(model | {"a_per_mm": -5.0}))
    (folder / "other.json").write_text(json.dumps(model | {"a_per_mm": 0.5}))
    (folder / "empty").mkdir(exist_ok=True)
    rows = [f"{second},{second},{second}" for second in range(20)]
    (folder / "one-way.csv").write_text("\n".join(["time_s,command_deg,angle_deg", *rows]))
    (folder / "data/one-way").mkdir(exist_ok=True)
    write_measured(folder / "data/one-way", "one-way", read_measured_log(folder / "one-way.csv"))
    return folder


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("identify cut --out x.json", "cut/episode.mcap is cut off"),
        ("identify table.mcap --out x.json", "table.mcap is not an MCAP file"),
        ("generate --command-csv nan.csv --out x", "nan.csv line 3: pull_mm"),
        (
            "import nan.csv --out x",
            "nan.csv has no column command_deg and no angle_deg; its columns: time_s, pull_mm",
        ),
        (
            "import nan.csv --command-column pull_mm --angle-column pull_mm --out x",
            "nan.csv: pull_mm is 0 in every row: a log without motion",
        ),
        (
            "import log.csv --time-column t --out x",
            "log.csv has no column t; its columns: time_s, command_deg",
        ),
        (
            "import log.csv --angle-unit rad --out x",
            "line 3: angle_deg is 1718.87 deg, which is not from -720",
        ),
        ("import log.csv --command-unit rad --out x", "check --command-unit and --pulley-radius-mm"),
        (
            "import log.csv --command-unit counts --out x",
            "--command-unit 'counts': must be one of deg, m, mm, rad (",
        ),
        ("import log.csv --name a/b --out x", "--name 'a/b'"),
        ("import log.csv --command-scale nan --out x", "--command-scale nan: must be a finite number"),
        (
            "train data/train --agent ram --model m.json --noise-level 1e300 --out x",
            "use --protocol free for --noise gaussian --noise-level 1e",
        ),
        ("import log.csv --out data/test", "dataset.json that no import wrote"),
        ("import log.csv --out table.mcap/x", "cannot write to the folder table.mcap/x"),
        ("generate --preset negative.yaml --out x", "wire_stiffness = -5.0: must be positive"),
        ("generate --out /proc/x", "cannot write to the folder /proc/x"),
        ("generate --stroke 4 2 --out x", "stroke [4, 2] mm"),
        ("train data/train --model model.json --out x", "model.json is no Coleman-Hodgdon model"),
        ("train data/train --model coleman_hodgdon.json --noise-level 1 --out x", "--protocol free"),
        ("train data/train --model coleman_hodgdon.json --sample-time 0.03 --out x", "--sample-time 0.03 s"),
        ("evaluate data/test --policy table.mcap --out x", "table.mcap is not a trained file"),
        (
            "evaluate data/test --sample-time 0.2 --policy runs/ram/policy.onnx --out x",
            "trained at T = 0.1 s",
        ),
        ("render data/test --out x.bmp", "must end in .png or .svg or .pdf or .mp4 or .gif"),
        ("render data/test --camera front --out x.png", "--camera 'front': must be one of side"),
        ("render data/test --time 99 --out x.png", "--time 99: must be from 0 to"),
        ("report empty --out x.html", "empty holds no run"),
        ("generat --out x", "did you mean 'generate'?"),
        ("generate --out x --bogus", "--bogus"),
        ("generate --stroke 2 400 --out x", "pulled by at most 51.1 mm: is the unit right?"),
        ("generate --seed -1 --out x", "--seed -1"),
        ("generate recipe.yaml --seed 5 --out data/train", "of another recipe"),
        (
            "generate recipe.yaml --episodes 1 --out data/train",
            "which is not among the one episode asked for",
        ),
        ("identify data/train --population 0 --out x.json", "population 0"),
        ("train data/train --model coleman_hodgdon.json --noises gamma --out x", "is for --protocol twins"),
        ("train --protocol twins --stroke -4 4000 --out x", "stroke [-4, 4000] mm: this endoscope is pulled"),
        ("train --protocol twins --agent gru --search --out x", "--search are for several trainings"),
        ("train data/train --model coleman_hodgdon.json --seeds 0 --out x", "seeds 0: must be at least 1"),
        (
            "evaluate data/test --model coleman_hodgdon.json --initial-error-deg nan --out x",
            "--initial-error-deg nan",
        ),
        ("evaluate data/test --policy runs/ram/policy.onnx runs/ram/policy.onnx --out x", "a second policy"),
        ("evaluate data/test --model other.json --policy runs/ram/policy.onnx --out x", "another model"),
        ("generate --preset bare.yaml --randomize --out x", "bare.yaml states no ranges"),
        ("calibrate --out x.yaml", "no data given"),
        ("calibrate data/one-way --out x.yaml", "the command never reverses"),
        ("demo --out .", "which no demo made"),
    ],
)
def test_a_mistake_is_one_line_exit_code_2_and_nothing_half_written(mistakes, line, fault):
    folder = mistakes
    code, _, said = typed(line, folder)
    assert code == 2
    assert fault in said
    assert len(said.strip().splitlines()) == 1
    assert "Traceback" not in said
    left = [folder / f"x{ending}" for ending in ("", ".json", ".png", ".gif", ".mp4", ".html")]
    assert not [path for path in left if path.is_file() or (path.is_dir() and any(path.iterdir()))]


@pytest.mark.parametrize("verb", VERBS)
def test_help_has_each_option_once_in_groups_and_ends_in_examples(verb, tmp_path):
    code, out, _ = typed(f"{verb} --help", tmp_path)
    assert code == 0
    paragraphs = out.rstrip().split("\n\n")
    title, *examples = paragraphs[-1].splitlines()
    assert title == "Examples:"
    assert len(examples) == 2
    assert all(example.startswith(f"  endotwin {verb} ") for example in examples)
    options, shown = options_of(verb), re.findall(r"^  (?:--|\[?PATH)", out, re.MULTILINE)
    fields = dataclasses.fields(options)
    assert len(shown) == len(fields)
    titles = [part.splitlines()[0] for part in paragraphs if part.splitlines()[0].endswith(":")]
    groups = getattr(options, "GROUPS", {})
    assert titles == ["Options:", *(f"{title}:" for title in groups), "Examples:"]
    assert len(groups) >= 3 or len(fields) <= 14
    assert not {"None", "STR", "FLOAT", "INT"} & set(out.split())


def test_help_names_values_by_their_units(tmp_path):
    for verb, words in [
        ("render", "--time SECONDS"),
        ("render", "--speed NUMBER"),  # a factor
        ("render", "--size WIDTH HEIGHT"),
        ("run", "--speed MM/S"),
        ("run", "--noise-variance DEG2"),
        ("train", "--sample-times SECONDS ..."),
        ("generate", "--stroke MM MM"),
        ("generate", "--set NAME=VALUE ..."),
    ]:
        assert re.search(f"^  {re.escape(words)}(  |$)", done(f"{verb} --help", tmp_path), re.MULTILINE)
