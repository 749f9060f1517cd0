"""Behaviour that all verbs share: a missing extra is one line, a fault of the program is not hidden."""

import dataclasses
import subprocess
import sys

import pytest
from repository import ENVIRONMENT, REPOSITORY

from scripts.command import Summary, describe_error, run_verb, with_flags
from scripts.generate import main
from twin.errors import MissingExtraError


@dataclasses.dataclass(frozen=True)
class Nothing:
    """Do nothing."""

    json: bool = False
    """Print the summary as one JSON object."""


def test_a_missing_extra_is_one_line_and_nothing_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)  # what Python holds of a module that is not there
    assert main(["--out", str(tmp_path / "data")]) == 2
    said = capsys.readouterr()
    assert said.err == "endotwin generate: this needs mujoco: pip install 'endotwin[sim]'\n"
    assert not any(tmp_path.iterdir())


WITHOUT_MUJOCO = """
import importlib.metadata as metadata, sys
sys.modules |= {"mujoco": None, "dm_control": None}
version = metadata.version
def installed(name):
    if name == "mujoco":
        raise metadata.PackageNotFoundError(name)
    return version(name)
metadata.version = installed
from scripts.generate import main
sys.exit(main(["--verify", "--out", "assets/samples/dataset"]))
"""


def test_a_dataset_is_verified_without_mujoco():
    words = [sys.executable, "-c", WITHOUT_MUJOCO]
    done = subprocess.run(words, cwd=REPOSITORY, capture_output=True, text=True, env=ENVIRONMENT)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "error",
    [
        ModuleNotFoundError("No module named 'torch'", name="torch"),
        MissingExtraError("this needs torch: pip install 'endotwin[rl]'", name="torch"),
    ],
)
def test_an_import_that_fails_while_a_verb_runs_says_what_to_install(capsys, error):
    def verb(_: Nothing) -> Summary:
        raise error

    verb.__module__ = "scripts.train"
    assert run_verb(Nothing, verb, []) == 2
    assert capsys.readouterr().err == "endotwin train: this needs torch: pip install 'endotwin[rl]'\n"


def test_a_parameter_of_the_sensor_is_shown_as_its_flag():
    @dataclasses.dataclass(frozen=True)
    class Run(Nothing):
        sensor_zero_deg: float = 0.0

    line = "sensor zero_deg = nan: must be from -180 to 180"
    assert with_flags(line, Run()) == "--sensor-zero-deg nan: must be from -180 to 180"
    assert with_flags(line, Nothing()) == line  # of a preset's file


def test_a_library_that_does_not_fit_into_memory_is_no_fault_of_the_program(monkeypatch):
    monkeypatch.setattr("twin.files.program._RUN", {})  # of other tests
    error = ImportError("IMPORTANT: PLEASE READ THIS FOR ADVICE")
    error.__cause__ = ImportError("libopenblas.so: failed to map segment from shared object")
    assert describe_error(error) == "out of memory: a package cannot be loaded"
    assert "a fault of the program" in describe_error(ImportError("libopenblas.so: no such file"))
