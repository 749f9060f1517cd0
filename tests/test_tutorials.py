"""Tutorials run as they are, and print what their pages say."""

import contextlib
import os
import re
import sys
from pathlib import Path
from unittest import mock

import pytest
from repository import ENVIRONMENT, REPOSITORY

sys.path.insert(0, str(REPOSITORY / "docs/site"))

import tutorials

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?")


@pytest.mark.parametrize("path", sorted(tutorials.FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_a_tutorial_runs_and_prints_what_it_says(path, tmp_path):
    search = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    with contextlib.chdir(tmp_path), mock.patch.dict(os.environ, ENVIRONMENT | search):
        cells = tutorials.run(path)
    assert len(cells) >= 4
    told, printed = (["\n".join(lines) for lines in side] for side in zip(*cells, strict=True))
    words = [[NUMBER.sub("#", text) for text in side] for side in (told, printed)]
    assert words[1] == words[0]
    for ours, page in zip(printed, told, strict=True):
        numbers = zip(map(float, NUMBER.findall(ours)), map(float, NUMBER.findall(page)), strict=True)
        for here, there in numbers:  # of another machine, or another version of a library
            assert here == pytest.approx(there, rel=0.35, abs=0.5), (ours, page)


def test_a_tutorial_is_a_notebook_with_text_code_and_output():
    page = tutorials.page(tutorials.FOLDER / "write_an_estimator.py")
    assert page.startswith("# Write an estimator")
    assert "```python" in page
    assert "```text\nR = 1: complementary" in page
    assert "# >" not in page
