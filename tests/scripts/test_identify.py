"""`endotwin identify`: the file of each model, and its parameters in words."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from identifying import TIME
from models import NAMES
from recorded import make_episode

from scripts.identify import main
from scripts.import_log import main as import_log
from twin.hysteresis import ColemanHodgdon, load_model
from twin.recording import write_episode


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A folder with one measured log, as `endotwin import` makes it."""
    folder = tmp_path_factory.mktemp("measured")
    drive = 90 * np.sin(2 * np.pi * TIME / 7)
    angle = ColemanHodgdon(0.05, 0.8, 0.3).response(drive, 0.0)
    rows = [f"{t:.1f},{command:.4f},{bend:.4f}" for t, command, bend in zip(TIME, drive, angle, strict=True)]
    (folder / "log.csv").write_text("\n".join(["time_s,command_deg,angle_deg", *rows]))
    assert import_log(["--out", str(folder / "data"), str(folder / "log.csv")]) == 0
    return folder / "data"


@pytest.mark.parametrize("name", NAMES)
def test_command_writes_the_model_and_names_its_parameters(name, tmp_path, monkeypatch, capsys, recorded):
    monkeypatch.chdir(tmp_path)
    words = [str(recorded), "--model", name, "--population", "8", "--generations", "3"]
    assert main(words) == 0
    line = capsys.readouterr().out
    file = tmp_path / f"{name.replace('-', '_')}.json"
    values = json.loads(file.read_text())
    model = load_model(file)
    assert model.name == values["model"] == name
    assert line.startswith(f"{file.name}: ")
    assert f"RMSE {values['rmse_deg']:.3f} deg over 1 records" in line
    for parameter in (field.name for field in dataclasses.fields(model)):
        assert f"{parameter} = " in line
        assert parameter in values
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"out": file.name, **values}


def lines_of(bend):
    rows = [f"{t:.2f},{pull:.5f},{angle:.5f}" for t, pull, angle in zip(*bend, strict=True)]
    return "\n".join(["time_s,pull_mm,angle_deg", *rows])


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """Two measured logs whose angles have zeros of their own, and whose command acts 120 ms late."""
    folder = tmp_path_factory.mktemp("late")
    time = np.arange(0, 30, 0.05)
    for name, offset, scale in (("one", 8.0, 1.0), ("two", -3.0, 1.5)):
        pull, late = (
            scale * (2 * np.sin(t) + np.sin(2.3 * t + 1)) for t in (time, np.maximum(time - 0.12, 0))
        )
        bend = ColemanHodgdon(0.4, 12.0, 7.0).response(late, 5.0) + offset
        (folder / f"{name}.csv").write_text(lines_of((time, pull, bend)))
        line = [str(folder / f"{name}.csv"), "--command-column", "pull_mm", "--out", str(folder / "data")]
        assert import_log(line) == 0
    return folder / "data"


FEW = ["--population", "20", "--generations", "10", "--sample-time", "0.05"]


def test_nuisances_of_measured_logs_are_stated_and_no_part_of_the_model(late, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    assert main([str(late), *FEW]) == 0
    line = capsys.readouterr().out
    assert re.search(
        r"; offsets from -[23]\.\d\d to [78]\.\d\d deg; the command acts 12\d ms late$", line.strip()
    )
    values = json.loads((tmp_path / "coleman_hodgdon.json").read_text())
    assert values["offsets_deg"] == [
        {"record": "one", "offset_deg": pytest.approx(8, abs=0.3)},
        {"record": "two", "offset_deg": pytest.approx(-3, abs=0.3)},
    ]
    assert values["delay_s"] == pytest.approx(0.12, abs=0.005)
    assert values["optimizer"].endswith(", then scipy least_squares with the nuisances")
    fitted = load_model(tmp_path / "coleman_hodgdon.json")
    assert fitted.b_deg_per_mm == pytest.approx(12, rel=0.03)
    assert not {"offsets_deg", "delay_s"} & fitted.to_dict().keys()

    assert main([str(late), *FEW, "--offset", "off", "--delay", "off"]) == 0
    plain = json.loads((tmp_path / "coleman_hodgdon.json").read_text())
    assert not {"offsets_deg", "delay_s", "fraction"} & plain.keys()
    assert plain["rmse_deg"] > 5 * values["rmse_deg"]


def test_a_phase_and_a_single_speed_have_no_delay_unless_asked_for(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    time = np.arange(0, 20, 0.05)
    triangle = 3 * np.abs((time / 4) % 2 - 1)
    (tmp_path / "a.csv").write_text(lines_of((time, triangle, 20 * triangle)))
    (tmp_path / "b.csv").write_text(
        lines_of((time, np.sin(time), 9 * np.sin(time))).replace("time_s", "p_rad")
    )
    read = ["--command-column", "pull_mm", "--out", "data"]
    assert import_log(["a.csv", *read]) == import_log(["b.csv", "--time-column", "p_rad", *read]) == 0
    for words, stated in (([], False), (["--delay", "on"], True)):
        assert main(["data", *FEW, "--generations", "2", *words, "--json"]) == 0
        assert ("delay_s" in json.loads(capsys.readouterr().out.splitlines()[-1])) is stated


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["--fraction", "nan"], "--fraction nan: must be above 0, at most 1"),
        (["--fraction", "1.01"], "--fraction 1.01: must be above 0"),
        (
            ["--offset", "on", "--model", "prandtl-ishlinskii"],
            "--offset on: a prandtl-ishlinskii model has no",
        ),
        (["--fraction", "0.001"], "the command never"),
    ],
)
def test_a_mistake_is_refused_before_the_fit(late, tmp_path, monkeypatch, capsys, words, fault):
    monkeypatch.chdir(tmp_path)
    assert main([str(late), *FEW, *words]) == 2
    assert fault in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_simulated_records_have_no_nuisances(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pull = 2 + np.sin(TIME)
    bend = np.radians(ColemanHodgdon(0.4, 12.0, 7.0).response(pull, 20.0) + 5)
    empty = make_episode(len(TIME))
    write_episode(
        tmp_path / "a.mcap",
        dataclasses.replace(empty, time=TIME, pull=pull * 1e-3, bend=bend, measured_bend=bend),
    )
    few = ["a.mcap", "--population", "8", "--generations", "3"]
    assert main([*few, "--out", "auto.json"]) == main(
        [*few, "--offset", "off", "--delay", "off", "--out", "off.json"]
    )
    assert Path("auto.json").read_bytes() == Path("off.json").read_bytes()
    assert "nuisances" not in Path("auto.json").read_text()
    assert main([*few, "--offset", "on", "--out", "on.json"]) == 0
    assert "nuisances" in Path("on.json").read_text()
