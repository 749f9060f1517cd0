"""`endotwin control`: a command compares controllers, goes on where it was stopped, refuses mistakes."""

import json

import pytest
from gated import export_small
from small_tracking import write_tiny
from typed import typed

from twin.control.controller import controller_specs
from twin.evaluation.sealed import sealed_seed

SHORT = "control --physics reduced --twins 2 --seconds 3 --candidates 2 --stroke -1 1 --workers 1 --out out"


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Two controllers without a trained file, on reduced plants."""
    folder = tmp_path_factory.mktemp("control")
    code, out, said = typed(f"{SHORT} --controller linear pid --json", folder)
    assert code == 0, said
    return folder, json.loads(out)


def test_rows_and_comparisons_of_every_signal_are_written(compared):
    folder, summary = compared
    written = json.loads((folder / "out/control.json").read_text())
    assert summary["controllers"] == ["linear", "pid"]
    assert summary["rows"] == len(written["rows"]) == 2 * 3
    row = written["rows"][0]
    names = ("controller", "noise", "level", "signal")
    assert [row[name] for name in names] == ["linear", "gaussian", 1.0, "sine"]
    assert row["stroke_mm"] == [-1.0, 1.0]
    assert row["rmse_ci95_deg"][0] <= row["rmse_deg"] <= row["rmse_ci95_deg"][1]
    assert {of["controller"]: of["tried"] for of in written["tuned"]} == {"linear": 2, "pid": 2}
    assert all(0 <= of["settings"]["lead_s"] <= 1 for of in written["tuned"])
    assert written["control"]["limits"] == [{"low_mm": -4.0, "high_mm": 4.0, "speed_mm_s": 5.0}]
    tables = (folder / "out/control.md").read_text()
    for text in ("| R = 1 ", "percentage of the uncompensated", "Reversals of the command"):
        assert text in tables
    assert {row["percent_of_uncompensated"] for row in written["rows"][:3]} == {100.0}
    assert {row["holding_reversals_per_s"] is None for row in written["rows"][:2]} == {True}
    page = (folder / "out/control.html").read_text()
    assert page.count("<img") == (4 if (folder / "out/poses.png").exists() else 3)
    assert "endotwin control --controller linear pid --stroke -1 1 --twins 2 --seconds 3" in page
    assert [of["controller"] for of in written["totals"]] == ["linear", "pid"]
    for name in ("tracking.png", "loops.png", "errors.png"):
        assert (folder / "out" / name).read_bytes().startswith(b"\x89PNG")


def test_the_sealed_suite_states_its_test_set_which_the_file_under_test_determines(tmp_path):
    write_tiny(tmp_path / "ppo.onnx")
    words = SHORT.replace("--twins 2 --seconds 3 --candidates 2", "--twins 1 --seconds 1 --candidates 1")
    words += " --suite sealed --controller linear --tracking-policy ppo.onnx --seed 3 --json"
    code, out, said = typed(words, tmp_path)
    assert code == 0, said
    written = json.loads((tmp_path / "out/control.json").read_text())
    test_set = f"{sealed_seed([tmp_path / 'ppo.onnx'], 3):016x}"
    assert json.loads(out)["test_set"] == written["control"]["test_set"] == test_set
    assert test_set in (tmp_path / "out/control.html").read_text()
    totals = written["totals"]
    assert (totals[0]["condition"], totals[0]["percent_of_uncompensated"]) == ("all conditions", 100)
    assert [of["condition"] for of in totals[1:]] == [row["condition"] for row in written["rows"][::3]]
    assert len(totals) > 6  # nothing touches the tip of a reduced endoscope


def test_a_record_that_is_not_ours_is_left_as_it_is(tmp_path):
    (tmp_path / "out/records").mkdir(parents=True)
    (tmp_path / "out/records/pid.mcap").write_bytes(b"a measured afternoon")
    code, _, said = typed(f"{SHORT} --controller linear pid", tmp_path)
    assert code == 2
    assert "pid.mcap" in said
    assert (tmp_path / "out/records/pid.mcap").read_bytes() == b"a measured afternoon"
    assert not (tmp_path / "out/control.json").exists()


@pytest.mark.slow
def test_the_same_command_goes_on_and_another_one_is_refused(compared):
    folder, _ = compared
    before = {path.name: path.stat().st_mtime_ns for path in (folder / "out/parts").iterdir()}
    code, _, said = typed(f"{SHORT} --controller linear pid", folder)
    assert code == 0, said
    assert {path.name: path.stat().st_mtime_ns for path in (folder / "out/parts").iterdir()} == before
    code, _, said = typed(f"{SHORT} --controller linear pid --seed 1", folder)
    assert code == 2
    assert "of another configuration (seed)" in said


@pytest.mark.slow
def test_the_results_do_not_depend_on_the_workers(compared, tmp_path):
    folder, _ = compared
    code, _, said = typed(f"{SHORT} --controller linear pid", folder)
    assert code == 0, said
    code, _, said = typed(f"{SHORT} --controller linear pid".replace("--workers 1", "--workers 2"), tmp_path)
    assert code == 0, said
    assert (tmp_path / "out/control.json").read_text() == (folder / "out/control.json").read_text()


@pytest.mark.slow
def test_every_controller_runs_on_a_trained_file(tmp_path):
    export_small(tmp_path / "policy.onnx")
    write_tiny(tmp_path / "ppo.onnx")
    words = SHORT.replace("--twins 2", "--twins 1").replace("--candidates 2", "--candidates 1")
    code, out, said = typed(f"{words} --policy policy.onnx --tracking-policy ppo.onnx --json", tmp_path)
    assert code == 0, said
    assert json.loads(out)["controllers"] == [spec.name for spec in controller_specs()]
    written = json.loads((tmp_path / "out/control.json").read_text())
    (own,) = {of["controller"] for of in written["comparisons"]}
    assert own == "members-inverse"
    assert len(written["comparisons"]) == len(controller_specs()) - 2  # itself, and the oracle


def test_a_policy_of_another_loop_is_refused_before_anything_runs(tmp_path):
    write_tiny(tmp_path / "ppo.onnx")
    words = f"{SHORT} --controller ppo --tracking-policy ppo.onnx"
    code, _, said = typed(f"{words} --speed 4", tmp_path)
    assert code == 2
    assert "speed limit = 4 mm/s: ppo.onnx was trained with" in said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("--controller pidd", "unknown controller 'pidd'; valid: all, linear"),
        ("--controller members-inverse", "'members-inverse' runs on a trained file of RAM (twins)"),
        ("--controller ppo", "'ppo' runs on a trained file of PPO on EndoTwin/Tracking-v0: none is given"),
        ("--policy nothing.onnx", "nothing.onnx"),
        ("--tracking-policy nothing.onnx", "no trained file nothing.onnx"),
        ("--suite long", "unknown suite 'long'; valid: short, full"),
        ("--stroke 1 1", "stroke [1, 1] mm: the first must be below the second"),
        ("--twins 0", "--twins 0: must be from 1 to 1000"),
        ("--speed 0", "must be positive"),
        ("--preset uretroscope", "did you mean 'ureteroscope'"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(tmp_path, words, fault):
    code, _, said = typed(f"control {words} --out out", tmp_path)
    assert code == 2
    assert fault in said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
