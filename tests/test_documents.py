"""Documents are true: their Python runs, and they name every method, verb and extra."""

import re
import subprocess
import sys
import tomllib

import pytest
from repository import REPOSITORY

from scripts.__main__ import VERBS
from twin.estimation.learned import graph_check
from twin.estimation.registry import method_specs
from twin.files import yaml_text

BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


def blocks() -> list[tuple[str, str]]:
    found = []
    for name in ("README.md", "docs/method.md", "docs/rendering.md"):
        text = (REPOSITORY / name).read_text()
        found += [(f"{name} {number}", code) for number, code in enumerate(BLOCK.findall(text))]
    return found


@pytest.mark.parametrize(("name", "code"), blocks(), ids=[name for name, _ in blocks()])
def test_python_of_a_document_runs(name, code, tmp_path):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-1000:]
    assert done.stdout


def test_every_method_has_its_row():
    table = (REPOSITORY / "docs/method.md").read_text()
    first = " ".join(line.split("|")[1] for line in table.splitlines() if line.startswith("| "))
    for spec in method_specs():
        assert spec.name in first or spec.name in (
            "UKF-tuned (Bouc-Wen)",  # three in one row
            "AM-tuned (Bouc-Wen)",
        ), spec.name


def test_readme_names_every_extra_and_its_commands_are_verbs():
    readme = (REPOSITORY / "README.md").read_text()
    extras = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra in extras.keys() - {"dev"}:
        assert f"endotwin[{extra}]" in readme
    verbs = re.findall(r"^endotwin (\w+)", readme, re.MULTILINE)
    assert len(verbs) > 8
    assert set(verbs) <= set(VERBS)


def test_limits_of_formats_are_those_of_their_readers():
    table = (REPOSITORY / "docs/files.md").read_text()
    assert f"20 levels, {yaml_text.MOST_NODES:,} values |" in table
    assert f" {graph_check.MOST_NODES} nodes of {len(graph_check.OPERATORS)} operators |" in table
