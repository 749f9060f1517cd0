"""The commands as a user types them: short real runs, and mistakes."""

import json
import subprocess
import sys

import numpy as np
import pytest
import yaml
from repository import REPOSITORY, endotwin
from typed import done, typed

from twin.measured.folder import write_measured
from twin.measured.log import read_measured_log
from twin.preset.file import load_preset
from twin.recording import read_dataset, read_episode


@pytest.fixture(scope="module")
def workspace(tmp_path_factory, few_steps):
    """A short run of every verb, in the order of the README, in one folder."""
    folder = tmp_path_factory.mktemp("workspace")
    (folder / "short.yaml").write_text((REPOSITORY / "assets" / "ureteroscope.yaml").read_text())
    (folder / "loop.csv").write_text("time_s,pull_mm\n0,0\n1,1\n3,-1\n4,0\n")
    coarse = load_preset("ureteroscope").replace(name="coarse", vertebrae=6, sheath_elements=4)
    (folder / "coarse.yaml").write_text(yaml.safe_dump(coarse.to_dict()))
    data = "--preset ureteroscope --episodes 2 --seconds 8"
    learn = "train data/train --model coleman_hodgdon.json --protocol strict --episodes 32"
    printed = {}
    for line in (
        f"generate {data} --stroke 2 4 --seed 1 --out data/train --json",
        f"generate {data} --stroke -1 1 --seed 2 --workers 1 --out data/test --format csv --json",
        "identify data/train --out coleman_hodgdon.json --generations 40 --json",
        f"{learn} --agent ram --out runs/ram --json",
        f"{learn} --agent direct --out runs/direct --json",
        f"{learn} --agent lstm --out runs/lstm --json",
        "evaluate data/test --train data/train --model coleman_hodgdon.json "
        "--policy runs/ram/policy.onnx runs/direct/policy.onnx runs/lstm/lstm.onnx "
        "--suite paper --seeds 2 --out results --json",
        "generate --preset ureteroscope --command-csv loop.csv --episodes 2 --out data/loops --json",
        "calibrate data/loops --preset short.yaml --free section_stiffness --starts 1 "
        "--out fitted.yaml --json",
        "benchmark --preset coarse.yaml --only return_point closed_cycles --cycles 4 "
        "--out benchmark.json --json",
        "render data/test --out bend.png --json",
        "render data/test --time 1 --camera endoscopic --background dark --dpi 80 --out pose.png --json",
        "render data/test --sheet 4 --transparent --size 400 300 --dpi 100 --out sheet.png --json",
        "render data/test data/test --ghost commanded --panels curves --out loops.svg --json",
        "render data/test --ghost coleman_hodgdon.json --sleeve whole --size 320 180 --out model.pdf --json",
        "render data/test --episode 1 --speed 6 --size 320 180 --out bend.mp4 --json",
        "report . --out report.html --json",
    ):
        printed[line.split()[0] + " " + line.split("--out ")[1].split()[0]] = json.loads(done(line, folder))
    return folder, printed


def test_every_verb_writes_what_it_says_and_prints_one_json_object(workspace):
    folder, printed = workspace
    for summary in printed.values():
        assert (folder / summary["out"]).exists()
    assert printed["generate data/train"]["episodes"] == 2
    assert printed["identify coleman_hodgdon.json"]["a_per_mm"] > 0
    assert not [path for path in folder.rglob(".*") if path.is_file()]


def test_calibration_leaves_a_preset_its_report_and_nothing_else(workspace):
    folder, printed = workspace
    summary = printed["calibrate fitted.yaml"]
    fitted, start = (load_preset(folder / name) for name in ("fitted.yaml", "short.yaml"))
    # from a log of the very preset, angles with noise: back to where it was, and nothing else changed
    assert fitted.section_stiffness == pytest.approx(start.section_stiffness, rel=0.02)
    assert fitted.replace(name="short", section_stiffness=start.section_stiffness) == start
    assert [log["rmse_deg"] < 0.5 for log in summary["logs"]] == [True, True]
    assert json.loads((folder / "fitted_fit.json").read_text())["parameters"].keys() == {"section_stiffness"}
    assert (folder / "fitted_fit.png").read_bytes().startswith(b"\x89PNG")


def test_benchmark_says_what_holds(workspace):
    folder, printed = workspace
    assert printed["benchmark benchmark.json"]["missed"] == []
    measured = json.loads((folder / "benchmark.json").read_text())
    assert measured.keys() == {"return_point", "closed_cycles"}
    assert {"value", "unit", "peer", "peer_value", "ratio", "machine"} <= measured["return_point"].keys()
    assert "Madelung" in (folder / "benchmark.md").read_text()


def test_generate_changes_draws_and_moves_what_it_is_told(tmp_path, no_workers):
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


def test_evaluation_has_a_row_of_every_method_and_noise(workspace):
    folder, _ = workspace
    evaluation = json.loads((folder / "results/evaluation.json").read_text())
    methods = {row["method"] for row in evaluation["rows"]}
    assert methods >= {"C-H", "AM", "LSTM", "Direct RL", "RAM", "AM-tuned", "Constant gain", "RAM (oracle)"}
    assert len(evaluation["rows"]) == 8 * len(methods)
    assert {row["oracle"] for row in evaluation["rows"] if "oracle" in row["method"]} == {True}
    assert evaluation["protocol"]["sample_time_s"] == 0.1
    assert "paper 0.635" in (folder / "results/tables.md").read_text()


def test_same_seed_same_table(workspace, tmp_path):
    folder, _ = workspace
    line = (
        "evaluate data/test --model coleman_hodgdon.json --policy runs/ram/policy.onnx --suite paper-only "
        "--seeds 2"
    )
    done(f"{line} --out {tmp_path}/one", folder)
    assert endotwin(*line.split(), "--out", tmp_path / "two", cwd=folder).returncode == 0
    first, second = ((tmp_path / name / "evaluation.json").read_bytes() for name in ("one", "two"))
    assert first == second


def test_a_method_that_is_not_given_is_trained_and_kept_beside_the_results(workspace, tmp_path):
    folder, _ = workspace
    line = (
        "evaluate data/test --train data/train --model coleman_hodgdon.json --suite paper-only --seeds 1 "
        f"--policy runs/ram/policy.onnx runs/lstm/lstm.onnx --episodes 32 --out {tmp_path}/results"
    )
    done(line, folder)
    assert (tmp_path / "results/direct/policy.onnx").is_file()
    assert not (tmp_path / "results/ram").exists()


def test_report_is_one_page_of_all_parts(workspace):
    folder, _ = workspace
    page = (folder / "report.html").read_text()
    assert "Table II" in page
    assert "This run has no" not in page.replace("This run has no demo.json", "")


def test_a_script_runs_by_its_path_too(tmp_path):
    ended = subprocess.run(
        [sys.executable, REPOSITORY / "scripts" / "generate.py", "--help"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert ended.returncode == 0
    assert "--sheath-bend-deg" in ended.stdout


def test_a_given_command_is_followed_at_another_bend_of_the_sheath(tmp_path, no_workers):
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


def test_what_is_odd_in_a_measured_log_is_one_line_of_warning(tmp_path):
    rows = [f"{second},{second},{second}" for second in [*range(9), 50]]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,command_deg,angle_deg", *rows]))
    code, out, err = typed("import log.csv --out out --name other", tmp_path)
    assert code == 0
    gap = "endotwin import: warning: log.csv line 11: a gap of 42 times the usual step comes before it\n"
    assert err == gap
    assert out.startswith(
        "out/other.mcap: 10 samples, 50 s at 1 Hz, pulled from 0 to 8.73 mm, bent from 0.0 to 50.0 deg"
    )


def test_a_mistake_is_the_exit_code_of_the_process_too(tmp_path):
    ended = endotwin("generate", "--preset", "ureterscope", "--out", "x", cwd=tmp_path)
    said = "endotwin generate: unknown preset 'ureterscope' (did you mean 'ureteroscope'?)"
    assert ended.returncode == 2
    assert ended.stderr.startswith(said)
    assert len(ended.stderr.splitlines()) == 1
    assert not any(tmp_path.iterdir())


@pytest.fixture(scope="module")
def mistakes(workspace):
    """The workspace, with files in it that are no good."""
    folder, _ = workspace
    whole = next((folder / "data/train").glob("*.mcap")).read_bytes()
    (folder / "cut").mkdir(exist_ok=True)
    (folder / "cut/episode.mcap").write_bytes(whole[: len(whole) // 2])
    (folder / "table.mcap").write_text("time_s,pull_mm\n0,1\n")
    (folder / "nan.csv").write_text("time_s,pull_mm\n0,0\n1,nan\n2,0\n")
    (folder / "log.csv").write_text("time_s,command_deg,angle_deg\n0,0,0\n1,60,30\n2,0,9\n")
    (folder / "back.csv").write_text("time_s,command_deg,angle_deg\n0,0,0\n2,60,30\n1,0,9\n")
    (folder / "still.csv").write_text("time_s,command_deg,angle_deg\n0,5,0\n2,5,30\n")
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
        ("identify cut --out x.json", "`endotwin export FILE --recover` saves what is whole"),
        ("identify table.mcap --out x.json", "table.mcap is not an MCAP file"),
        ("identify nowhere --out x.json", "nowhere"),
        ("identify empty --out x.json", "empty"),
        ("generate --command-csv nan.csv --out x", "nan.csv line 3: pull_mm is 'nan'"),
        ("import none.csv --out x", "endotwin import: no file none.csv"),
        ("import nan.csv --out x", "nan.csv has no column command_deg; its columns: time_s, pull_mm"),
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
        ("import log.csv --pulley-radius-mm 0 --out x", "--pulley-radius-mm is 0 m: must be positive"),
        ("import log.csv --seconds-per-cycle nan --out x", "--seconds-per-cycle nan: must be positive"),
        ("import log.csv --command-unit turns --out x", "turns"),
        ("import log.csv --name a/b --out x", "--name 'a/b'"),
        ("import log.csv --out data/test", "dataset.json that no import wrote"),
        ("import log.csv --out cut", "cut holds episode.mcap, which no import wrote"),
        ("import log.csv --out table.mcap/x", "cannot write to the folder table.mcap/x"),
        ("import back.csv --out x", "back.csv line 4: time_s runs backwards"),
        ("import still.csv --out x", "a log without motion"),
        ("import table.mcap --out x", "table.mcap has no column command_deg"),
        ("import cut/episode.mcap --out x", "cut/episode.mcap is not a CSV file"),
        ("import log.csv", "--out"),
        ("generate --preset negative.yaml --out x", "wire_stiffness = -5.0: must be positive"),
        (
            "generate --preset ureterscope --out x",
            "unknown preset 'ureterscope' (did you mean 'ureteroscope'?)",
        ),
        ("generate --out /proc/x", "cannot write to the folder /proc/x"),
        ("generate --out table.mcap/x", "cannot write to the folder table.mcap/x"),
        ("generate --stroke 4 2 --out x", "stroke [4, 2] mm"),
        ("generate --signal sinus --out x", "unknown signal 'sinus'; valid: all, sine"),
        ("generate --episodes 0 --out x", "--episodes 0"),
        ("train data/train --model model.json --out x", "model.json is no Coleman-Hodgdon model"),
        ("train data/train --model coleman_hodgdon.json --noise-level 1 --out x", "--protocol free"),
        ("train data/train --model coleman_hodgdon.json --sample-time 0.03 --out x", "--sample-time 0.03 s"),
        ("evaluate data/test --policy table.mcap --out x", "table.mcap is not a trained file"),
        ("evaluate data/test --suite ful --out x", "unknown suite 'ful'"),
        (
            "evaluate data/test --sample-time 0.2 --policy runs/ram/policy.onnx --out x",
            "trained at T = 0.1 s",
        ),
        ("render data/test --out x.bmp", "must end in .png or .svg or .pdf or .mp4 or .gif"),
        ("render --out x.png", "no data given"),
        ("render data/test --camera front --out x.png", "--camera 'front': must be one of side"),
        ("render data/test --background red --out x.png", "--background 'red': must be one of white"),
        ("render data/test --transparent --background dark --out x.png", "choose one"),
        ("render data/test --transparent --out x.mp4", "--background transparent: is of a picture"),
        ("render data/test --time 99 --out x.png", "--time 99: must be from 0 to"),
        ("render data/test --time 1 --out x.mp4", "--time 1: is of a picture"),
        ("render data/test --sheet 1 --out x.png", "--sheet 1: must be from 2 to 60"),
        ("render data/test --size 100 100 --out x.png", "size 100 x 100: must be from 160 x 120"),
        ("render data/test --dpi 5 --out x.png", "--dpi 5: must be from 50 to 1200"),
        ("render data/test --ghost absurd.json --out x.png", "the first two positive"),
        ("render data/test --ghost none.json --out x.png", "none.json"),
        ("render data/test --episode 9 --out x.png", "--episode 9"),
        ("report empty --out x.html", "empty holds no run"),
        ("generat --out x", "did you mean 'generate'?"),
        ("generate --episodes abc --out x", "invalid literal for int() with base 10: 'abc'"),
        ("generate --stroke 2 --out x", "--stroke ['2']: must be FLOAT FLOAT"),
        ("generate --out x --bogus", "--bogus"),
        ("generate --preset ureteroscope", "--out"),
        ("generate --stroke 2 400 --out x", "pulled by at most 51.1 mm: is the unit right?"),
        ("generate --sample-time nan --out x", "sample_time_s = nan: input should be a finite number"),
        ("generate --seed -1 --out x", "--seed -1"),
        ("generate --stroke -1 1 --episodes 2 --seconds 8 --seed 1 --out data/train", "of another recipe"),
        (
            "generate --episodes 1 --seconds 8 --seed 1 --out data/train",
            "which is not among the one episode asked for",
        ),
        ("identify data/train --population 0 --out x.json", "population 0"),
        ("identify data/train --sample-time inf --out x.json", "--sample-time inf: must be from"),
        ("train data/train --model coleman_hodgdon.json --clip inf --out x", "--clip inf"),
        ("train data/train --model absurd.json --out x", "the first two positive"),
        ("train data/train --model coleman_hodgdon.json --workers 2 --out x", "are for several trainings"),
        ("train data/train --model coleman_hodgdon.json --noises gamma --out x", "is for --protocol twins"),
        ("train data/train --model coleman_hodgdon.json --preset vio_com --out x", "is for --protocol twins"),
        ("train --protocol twins --stroke -4 4000 --out x", "stroke [-4, 4000] mm: this endoscope is pulled"),
        (
            "train --protocol twins --agent gru --search --out x",
            "--search are for several trainings",
        ),
        ("train data/train --model m.json --seeds 2 --search --out x", "--search is for --protocol twins"),
        ("train --protocol twins --stroke 4 -4 --out x", "stroke [4, -4] mm: must rise"),
        ("train --protocol twins --sample-times 0.05 --out x", "sample times 0.05 s: valid are 0.1, 0.04"),
        ("train --protocol twins --gain sac --out x", "gain sac: valid are analytic; ppo; analytic ppo"),
        (
            "train data/train --model coleman_hodgdon.json --gain ppo --out x",
            "--gain is for --protocol twins",
        ),
        ("train --protocol twins --noises gaussian cauchy --out x", "training noises cauchy: choose from"),
        ("train data/train --model coleman_hodgdon.json --seeds 0 --out x", "seeds 0: must be at least 1"),
        (
            "evaluate data/test --model coleman_hodgdon.json --initial-error-deg nan --out x",
            "--initial-error-deg nan",
        ),
        ("evaluate data/test --policy runs/ram/policy.onnx runs/ram/policy.onnx --out x", "a second policy"),
        (
            "evaluate data/test --model other.json --policy runs/ram/policy.onnx --out x",
            "beside another model",
        ),
        ("render data/test --speed inf --out x.mp4", "speed inf"),
        ("generate --set wire_stifness=1 --out x", "did you mean 'wire_stiffness'?"),
        ("generate --set wire_stiffness --out x", "must be NAME=VALUE"),
        ("generate --lateral-stroke -1 1 --out x", "has one bending plane, it needs two"),
        ("generate --preset bare.yaml --randomize --out x", "bare.yaml states no ranges"),
        ("generate --sheath-bend-to-deg -5 --out x", "bend of the sheath -5 deg: must be from 0"),
        ("calibrate --out x.yaml", "no data given"),
        ("calibrate data/test --out x.json", "must end in .yaml"),
        ("calibrate data/test --free mass --out x.yaml", "unknown preset parameter 'mass'"),
        ("calibrate data/test --fraction 2 --out x.yaml", "--fraction 2"),
        ("calibrate data/test --pace 0 --out x.yaml", "--pace 0"),
        ("calibrate data/test --starts 0 --out x.yaml", "--starts 0"),
        ("calibrate data/one-way --out x.yaml", "the command never reverses"),
        ("benchmark --only speed --out x.json", "unknown measurement 'speed'; valid: rate_independence"),
        ("benchmark --draws 0 --out x.json", "must be positive"),
        ("demo --out .", "which no demo made"),
        ("demo --records 0 --out x", "--records 0"),
    ],
)
def test_a_mistake_is_one_line_exit_code_2_and_nothing_half_written(mistakes, line, fault):
    folder = mistakes
    code, _, said = typed(line, folder)
    assert code == 2
    assert fault in said
    assert len(said.strip().splitlines()) == 1
    assert "Traceback" not in said
    left = [
        folder / "x",
        folder / "x.json",
        folder / "x.png",
        folder / "x.gif",
        folder / "x.mp4",
        folder / "x.html",
    ]
    assert not [path for path in left if path.is_file() or (path.is_dir() and any(path.iterdir()))]
