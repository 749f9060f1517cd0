"""docs/deployment.md is true: its commands run, its tables are those of the enums, its Python works."""

import enum
import importlib
import inspect
import io
import json
import re
import shlex
import subprocess
import sys
from unittest import mock

import numpy as np
import pytest
from repository import ENVIRONMENT, REPOSITORY
from typed import done, typed

from scripts.__main__ import VERBS
from scripts.command import MODULES, _parse
from twin.live.lines import HealthPart, ReadingLine, SampleLine, read_sample
from twin.live.reading import Alarm, Health

TEXT = (REPOSITORY / "docs/deployment.md").read_text()
TRAINED = "runs/ram_twins/policy.onnx"
TAKES_LONG = {"calibrate", "gate", "train"}
"""Verbs whose lines are parsed here, not run: each is run in its own tests."""


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


def ten_lines() -> list[str]:
    return [line for line in blocks("")[0].splitlines() if not line.startswith("#")]


def without_redirections(line: str) -> list[str]:
    """The words of a command line behind `endotwin`."""
    return shlex.split(re.sub(r" [<>] \S+", "", line))[1:]


def commands() -> list[str]:
    """Every command of the document, in its blocks and in its text."""
    lines = [line for block in blocks("") for line in block.splitlines() if "endotwin " in line]
    return [line[line.index("endotwin ") :] for line in lines if not line.startswith("#")]


@pytest.mark.parametrize("line", commands())
def test_a_command_is_a_verb_with_its_options(line):
    verb, *words = without_redirections(line)
    assert verb in VERBS
    module = importlib.import_module(f"scripts.{MODULES.get(verb, verb)}")
    parsed = []

    def parse(options, *_):
        parsed.append(_parse(options, verb, words))

    with mock.patch.object(module, "run_verb", parse):
        module.main(words)
    assert parsed != [None]
    assert len(parsed) == 1


def test_the_ten_lines_run(tmp_path, ram_policy):
    time = np.arange(120) * 0.1
    rows = zip(time, np.sin(time), 20 * np.sin(time - 0.3), strict=True)
    log = "time_s,pull_mm,angle_deg\n" + "".join("{:.6g},{:.6g},{:.6g}\n".format(*row) for row in rows)
    (tmp_path / "bench.csv").write_text(log)
    (tmp_path / "runs/device").mkdir(parents=True)
    (tmp_path / "runs/device/policy.onnx").write_bytes(ram_policy.read_bytes())
    ran = []
    for line in ten_lines():
        verb, *words = without_redirections(line)
        ran.append(verb)
        if verb in TAKES_LONG:
            continue
        samples = b'{"time_s":0,"pull_mm":0.1,"measurement_deg":2}\n{"time_s":0.1}\n'
        with mock.patch.object(sys, "stdin", io.TextIOWrapper(io.BytesIO(samples))):
            ended = typed(shlex.join([verb, *words]), tmp_path)
        assert ended.code == 0, ended.err
        if "<" in line:
            assert len(ended.out.splitlines()) == 2
        else:
            assert "120 samples" in ended.out
    assert ran == ["import", "calibrate", "train", "gate", "run", "run"]
    assert len(blocks("")[0].splitlines()) <= 10
    assert (tmp_path / "run.mcap").is_file()
    assert (tmp_path / "live.mcap").is_file()


def test_the_readme_shows_the_same_lines():
    readme = (REPOSITORY / "README.md").read_text().partition("\n## On a device\n")[2]
    assert re.findall(r"```\n(.*?)```", readme, re.DOTALL)[0].splitlines() == ten_lines()


def test_its_python_runs(tmp_path, ram_policy):
    (tmp_path / "runs/ram_twins").mkdir(parents=True)
    (tmp_path / TRAINED).write_bytes(ram_policy.read_bytes())
    (code,) = blocks("python")
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env=ENVIRONMENT
    )
    assert ended.returncode == 0, ended.stderr[-500:]
    assert "Source." in ended.stdout


def meanings(flags: type[enum.Flag]) -> dict[str, str]:
    """Meaning of each member of an enum, by its docstring."""
    section = (inspect.getdoc(flags) or "").partition("\nAttributes:\n")[2]
    told = re.findall(r"^    (\w+): (.+(?:\n        .+)*)", section, re.MULTILINE)
    named = {name: " ".join(text.split()) for name, text in told}
    return {str(flag.name): named[str(flag.name)] for flag in flags}


def rows(heading: str) -> dict[str, str]:
    table = TEXT.partition(f"| {heading} | means |\n|---|---|\n")[2].partition("\n\n")[0]
    return dict(re.findall(r"^\| `(\w+)` \| (.+) \|$", table, re.MULTILINE))


@pytest.mark.parametrize(("heading", "flags"), [("fault", Health), ("alarm", Alarm)])
def test_the_table_of_flags_is_that_of_the_enum(heading, flags):
    right = "\n".join(f"| `{name}` | {text} |" for name, text in meanings(flags).items())
    assert rows(heading) == meanings(flags), f"the rows must be:\n{right}"
    assert list(rows(heading)) == list(meanings(flags))


def test_the_protocol_names_every_key():
    keys = {*SampleLine.model_fields, *ReadingLine.model_fields} - {"health"}
    keys |= {f"health.{name}" for name in HealthPart.model_fields} | {"error", "line"}
    assert keys == set(re.findall(r"^\| `([a-z_.]+)` \| ", TEXT, re.MULTILINE))


def test_the_lines_that_it_shows_are_of_the_protocol():
    shown, wanted = (block for block in blocks("") if block.startswith("{"))
    assert read_sample(wanted.encode()).model_dump() == {
        "time_s": 0.02,
        "pull_mm": 0.0,
        "measurement_deg": 0.4,
        "reference_deg": 0.5,
        "coming_deg": None,
    }
    line, answer = shown.splitlines()
    assert read_sample(line.encode()).measurement_deg == 1.3
    assert ReadingLine.model_validate(json.loads(answer)).source == "advanced"


def test_help_of_the_verb_shows_a_line_of_the_protocol(tmp_path):
    from scripts.run import Run

    (line,) = re.findall(r"\{.*\}", inspect.getdoc(Run) or "")
    assert read_sample(line.encode()).measurement_deg == 1.3
    with pytest.raises(SystemExit) as end:
        done("run --help", tmp_path)
    assert not end.value.code
