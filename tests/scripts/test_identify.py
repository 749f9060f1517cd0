"""`endotwin identify`: the file of each model, and its parameters in words."""

import dataclasses
import json

import numpy as np
import pytest
from identifying import TIME

from scripts.identify import main
from scripts.import_log import main as import_log
from twin.hysteresis import MODELS, ColemanHodgdon, load_model


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


@pytest.mark.parametrize("name", MODELS)
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


def test_command_refuses_a_constraint_that_the_model_does_not_have(tmp_path, monkeypatch, capsys, recorded):
    monkeypatch.chdir(tmp_path)
    assert main([str(recorded), "--model", "bouc-wen", "--monotone"]) == 2
    assert "coleman-hodgdon models only, not bouc-wen" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.json"))
