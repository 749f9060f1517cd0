"""Every command and snippet of README, docs and `--help` is parsed as printed; `make validate` runs them.

They run at a small size: `documented.SMALLER` states by what each long one is shortened. Besides, trained
files are exported by tracing, filters are tuned by 150 evaluations, members are chosen from a few, and the
gate takes two twins.
"""

import base64
import contextlib
import dataclasses
import glob
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import briefly
import documented
import gated
import nbformat
import pytest
import tyro
from documented import (
    ALONE,
    HELP,
    NOT_RUN,
    TOGETHER,
    Snippet,
    documents,
    inline_commands,
    options_of,
    snippets,
    words_of,
)
from repository import ENVIRONMENT, REPOSITORY
from typed import done, typed_words

from scripts.__main__ import VERBS
from scripts.samples import copy_samples
from twin.dataset.recipe_file import load_recipe
from twin.estimation import registry
from twin.live.lines import ReadingLine, SampleLine, read_sample

sys.path.insert(0, str(REPOSITORY / "docs/site"))

import tutorials

EVERY = [snippet for document in (*documents(), HELP) for snippet in snippets(document)]
MAY_REFUSE = {"endotwin gate": (0, 1)}
"""Exit codes of commands that may refuse: an estimator that has hardly learned is a no-go."""
SECONDS = 600
"""The longest that one command may take at its small size."""
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?")
SEARCH = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def test_every_command_is_parsed_as_it_is_printed():
    commands = {snippet.text: snippet.name for snippet in EVERY if snippet.text.startswith("endotwin ")}
    assert len(commands) > 60
    for text, name in commands.items():
        _, verb, *words = words_of(text)
        try:
            assert tyro.cli(options_of(verb), args=words) is not None
        except SystemExit:
            pytest.fail(f"{name}: {text}")


def test_every_command_in_a_sentence_has_a_verb_and_options_that_exist():
    known = {
        verb: {f"--{field.name.replace('_', '-')}" for field in dataclasses.fields(options_of(verb))}
        for verb in VERBS
    }
    for document in documents():
        for command in inline_commands(document):
            _, verb, *words = command.split()
            if verb not in ("VERB", "VERB`", "--version"):
                flags = {word for word in words if word.startswith("--")}
                assert flags <= known[verb] | {"--help"}, f"{document}: {command}"


def test_every_command_has_its_place_among_those_that_are_run():
    commands = {snippet.document for snippet in EVERY if snippet.language == "sh" and snippet.is_run}
    assert commands <= {*TOGETHER, *ALONE}
    for part in NOT_RUN:
        assert any(part in snippet.text for snippet in EVERY), part


def test_lines_of_the_stream_and_recipes_that_are_printed_are_valid(tmp_path):
    copy_samples(tmp_path)
    blocks = documented._FENCE.findall((REPOSITORY / "docs/dataset.md").read_text())
    recipes = []
    for body in [body for _, language, body in blocks if language == "yaml"]:
        (tmp_path / "recipe.yaml").write_text(body)
        with contextlib.chdir(tmp_path):
            recipes.append(load_recipe(tmp_path / "recipe.yaml"))
    recorded, drawn = recipes
    assert recorded.given_lateral_pull_m is not None
    assert "sheath_bend" in drawn.ranges.to_dict()
    text = (REPOSITORY / "docs/deployment.md").read_text()
    lines = [line for line in text.splitlines() if line.startswith("{")]
    assert len(lines) >= 3
    for line in lines:
        if "bend_deg" in line:
            ReadingLine.model_validate(json.loads(line))
        else:
            SampleLine.model_validate(json.loads(line))
            read_sample(line.encode())


def test_the_first_commands_of_the_quick_start_run(tmp_path):
    first = [s for s in snippets("docs/quickstart.md") if s.text.startswith("endotwin ")][:2]
    for snippet in first:
        done(snippet.text.removeprefix("endotwin "), tmp_path)
    assert (tmp_path / "dataset/report.html").is_file()


def fault_of(snippet: Snippet, folder: Path) -> str:
    """Run a command or Python in a folder; the end of what a failure prints, else empty."""
    text = snippet.small
    good = next((codes for part, codes in MAY_REFUSE.items() if part in text), (0,))
    if snippet.language == "sh" and text.startswith("endotwin ") and not {"<", ">"} & set(text.split()):
        with mock.patch.dict(os.environ, ENVIRONMENT | SEARCH):  # here: a start costs more than most commands
            words = shlex.split(text)[1:]
            words = [path for word in words for path in sorted(glob.glob(word, root_dir=folder)) or [word]]
            code, _, said = typed_words(words, folder)
    else:
        command = [sys.executable, "-c", text] if snippet.language == "python" else ["bash", "-c", text]
        options = {
            "cwd": folder,
            "env": ENVIRONMENT | SEARCH,
            "stdin": subprocess.DEVNULL,
            "timeout": SECONDS,
        }
        ended = subprocess.run(command, capture_output=True, text=True, **options)
        code, said = ended.returncode, ended.stderr
    return "" if code in good else f"{snippet.name}: {text}\n{said[-1000:]}"


def run_all(names: tuple[str, ...], folder: Path) -> None:
    """Run all snippets of documents one after the other, each command once, and print how long each took."""
    copy_samples(folder)
    shutil.copytree(REPOSITORY / "docs/examples", folder / "docs/examples")
    found: dict[str, Snippet] = {}
    for snippet in (snippet for name in names for snippet in snippets(name) if snippet.is_run):
        found.setdefault(snippet.text, snippet)
    faults = []
    for snippet in found.values():
        begin = time.monotonic()
        faults.append(fault_of(snippet, folder))
        print(f"{time.monotonic() - begin:6.1f} s  {snippet.name}: {snippet.small[:90]!r}", flush=True)
    assert not any(faults), "\n\n".join(filter(None, faults))


@pytest.fixture
def shortened(monkeypatch):
    """Searches cut short, and exports by tracing."""
    import quick_export

    quick_export.take(monkeypatch)
    briefly.tune_filters(monkeypatch)
    briefly.choose_members(monkeypatch)
    briefly.work_in_place(monkeypatch)
    registry.method_specs()  # filled, before a copy takes the methods of examples
    monkeypatch.setattr(registry, "_SPECS", dict(registry._SPECS))
    monkeypatch.setattr("twin.gate.QUICK", gated.SMALL)


@pytest.mark.slow
@pytest.mark.parametrize("names", [TOGETHER, ALONE], ids=["documents", "quick start"])
def test_commands_and_snippets_run_in_their_order_at_a_small_size(names, tmp_path, shortened):
    run_all(names, tmp_path)


@pytest.mark.slow
def test_snippets_of_other_documents_run(tmp_path):
    others = [s for s in EVERY if s.language == "python" and s.document not in (*TOGETHER, *ALONE)]
    assert others
    for snippet in others:
        assert not fault_of(snippet, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(tutorials.FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_a_tutorial_runs_and_prints_what_it_states(path, tmp_path):
    with contextlib.chdir(tmp_path), mock.patch.dict(os.environ, ENVIRONMENT | SEARCH):
        cells = tutorials.run(path)
    assert len(cells) >= 4
    stated, printed = (["\n".join(lines) for lines in side] for side in zip(*cells, strict=True))
    words = [[NUMBER.sub("#", text) for text in side] for side in (stated, printed)]
    assert words[1] == words[0]
    for ours, page in zip(printed, stated, strict=True):
        numbers = zip(map(float, NUMBER.findall(ours)), map(float, NUMBER.findall(page)), strict=True)
        for here, there in numbers:  # of another machine, or another version of a library
            assert here == pytest.approx(there, rel=0.35, abs=0.5), (ours, page)


def test_a_tutorial_is_a_page_with_text_code_and_output():
    page = tutorials.page(tutorials.FOLDER / "write_an_estimator.py")
    assert "```python" in page
    assert "```text" in page


def test_a_tutorial_is_a_notebook_with_what_its_cells_print_and_show():
    content = nbformat.reads(tutorials.notebook(tutorials.FOLDER / "write_an_estimator.py"), 4)
    nbformat.validate(content)
    outputs = [output for cell in content.cells for output in cell.get("outputs", ())]
    assert "0.89" in next(of.text for of in reversed(outputs) if of.output_type == "stream")
    (figure,) = (of.data["image/png"] for of in outputs if of.output_type == "display_data")
    assert base64.b64decode(figure).startswith(b"\x89PNG")
    assert not [cell for cell in content.cells if tutorials.MARK in cell.source]


def test_every_claim_of_the_readme_is_one_of_what_we_found():
    """Claims are in bold."""
    found = (REPOSITORY / "docs/what_we_found.md").read_text()
    claims = re.findall(r"\*\*(.+?)\*\*", (REPOSITORY / "README.md").read_text())
    assert claims
    assert [claim for claim in claims if claim.rstrip(".") not in found] == []
