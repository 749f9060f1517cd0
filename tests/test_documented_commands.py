"""Every command and every snippet of README and docs does what it is printed for.

Every command is parsed as it is printed. Each run of the tests then runs them at a small size (`SMALLER`, in
`documented`, says what is made smaller; what it does not name is run as it is printed), but for the heaviest
(`HEAVY`), in whose place a trained file is put. `make validate` runs all of them at a small size, and as they
are printed those that do not take hours (`HOURS`).
"""

import contextlib
import dataclasses
import importlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import documented
import pytest
import tyro
from documented import ALONE, NOT_RUN, TOGETHER, Snippet, documents, inline_commands, snippets, words_of
from repository import ENVIRONMENT, REPOSITORY
from typed import typed

from scripts.__main__ import VERBS
from scripts.command import MODULES
from twin.dataset.recipe_file import load_recipe
from twin.files.json_text import parse_json_object
from twin.live.lines import SampleLine
from twin.samples.copy import copy_samples

HOURS = ("endotwin control", "--suite full", "--suite untrained", "train_tracking")
"""Parts of commands that take hours as printed: they are run at a small size alone."""
REFUSED = {"endotwin gate": (0, 1)}
"""Exit codes of commands that may say no: an estimator that has hardly learned is a no-go."""


def ids(found):
    return [snippet.name for snippet in found]


EVERY = [snippet for document in documents() for snippet in snippets(document)]
COMMANDS = [snippet for snippet in EVERY if snippet.language == "sh" and snippet.is_run]


def options_of(verb: str) -> type:
    """The dataclass of options of a verb."""
    module = importlib.import_module(f"scripts.{MODULES.get(verb, verb)}")
    return next(
        value
        for value in vars(module).values()
        if isinstance(value, type) and dataclasses.is_dataclass(value) and value.__module__ == module.__name__
    )


@pytest.mark.parametrize(
    "snippet", [s for s in EVERY if s.text.startswith("endotwin ")], ids=lambda s: s.name
)
def test_every_command_is_parsed_as_it_is_printed(snippet):
    _, verb, *words = words_of(snippet.text)
    assert tyro.cli(options_of(verb), args=words) is not None


def test_documents_print_many_commands_and_every_one_is_in_the_order_of_the_test():
    assert len(EVERY) > 60
    placed = set(TOGETHER) | set(ALONE)
    assert {snippet.document for snippet in COMMANDS} <= placed


def test_what_is_not_run_is_there():
    """Else the list of exceptions would outlive what it excuses."""
    for part in NOT_RUN:
        assert any(part in snippet.text for snippet in EVERY), part


def test_every_command_in_a_sentence_has_a_verb_and_options_that_exist():
    known = {
        verb: {f"--{field.name.replace('_', '-')}" for field in dataclasses.fields(options_of(verb))}
        for verb in VERBS
    }
    for document in documents():
        for command in inline_commands(document):
            words = command.split()
            if words[1] in ("VERB", "VERB`", "--version"):
                continue
            assert words[1] in VERBS, f"{document}: {command}"
            for word in words[2:]:
                if word.startswith("--"):
                    assert word in known[words[1]] | {"--help"}, f"{document}: {command}"


def unique(names: tuple[str, ...]) -> list[Snippet]:
    """Snippets of some documents in order, each command once."""
    found: dict[str, Snippet] = {}
    for name in names:
        for snippet in snippets(name):
            if snippet.is_run:
                found.setdefault(snippet.text, snippet)
    return list(found.values())


def run(snippet: Snippet, text: str, folder: Path, timeout: float) -> None:
    """Run a command or Python in a folder; a failure names where it is printed."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = ENVIRONMENT | {"PATH": path}
    good = next((codes for part, codes in REFUSED.items() if part in text), (0,))
    plain = snippet.language == "sh" and text.startswith("endotwin ") and not {"<", ">"} & set(text.split())
    if plain and timeout < 1000:  # in this process: a start of its own costs more than most commands
        with mock.patch.dict(os.environ, environment):
            code, _, said = typed(text.removeprefix("endotwin "), folder)
    else:
        command = [sys.executable, "-c", text] if snippet.language == "python" else ["bash", "-c", text]
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, env=environment, timeout=timeout
        )
        code, said = done.returncode, done.stderr
    assert code in good, f"{snippet.name}: {text}\n{said[-1500:]}"


def run_all(names: tuple[str, ...], folder: Path, *, small: bool, heavy: bool = True) -> dict[str, float]:
    """Run all snippets of documents one after the other; returns what each took [s]."""
    copy_samples(folder)
    shutil.copytree(REPOSITORY / "docs/examples", folder / "docs/examples")
    took = {}
    for snippet in unique(names):
        if snippet.is_heavy and not heavy:
            continue
        long = any(part in snippet.text for part in HOURS)
        begin = time.monotonic()
        run(snippet, snippet.small if small or long else snippet.text, folder, 120 if small else 7200)
        took[snippet.name] = round(time.monotonic() - begin, 1)
    return took


@pytest.mark.parametrize("names", [TOGETHER, ALONE], ids=["documents", "quick start"])
def test_commands_and_snippets_run_in_their_order_at_a_small_size(names, tmp_path, twins_policy):
    for run_folder in ("ram_twins", "device"):
        (tmp_path / "runs" / run_folder).mkdir(parents=True)
        shutil.copy(twins_policy, tmp_path / "runs" / run_folder / "policy.onnx")
    took = run_all(names, tmp_path, small=True, heavy=False)
    slowest = sorted(took.items(), key=lambda item: -item[1])[:12]
    print(f"{len(took)} snippets, {sum(took.values()):.0f} s; the slowest:", slowest)
    assert len(took) > 5


@pytest.mark.slow
@pytest.mark.parametrize("names", [TOGETHER, ALONE], ids=["documents", "quick start"])
def test_every_command_runs_at_a_small_size(names, tmp_path):
    print(run_all(names, tmp_path, small=True))


@pytest.mark.slow
@pytest.mark.parametrize("names", [TOGETHER, ALONE], ids=["documents", "quick start"])
def test_commands_and_snippets_run_as_they_are_printed(names, tmp_path):
    print(run_all(names, tmp_path, small=False))


def test_snippets_of_other_documents_run(tmp_path):
    """Of CONTRIBUTING and of what is no part of the sequence."""
    others = [s for s in EVERY if s.language == "python" and s.document not in (*TOGETHER, *ALONE)]
    assert others
    for snippet in others:
        run(snippet, snippet.text, tmp_path, 120)


def test_the_recipe_and_the_lines_of_a_stream_that_are_printed_are_valid(tmp_path):
    copy_samples(tmp_path)
    blocks = documented._FENCE.findall((REPOSITORY / "docs/dataset.md").read_text())
    (recipe,) = [body for _, language, body in blocks if language == "yaml"]
    (tmp_path / "recipe.yaml").write_text(recipe)
    with contextlib.chdir(tmp_path):
        assert load_recipe(tmp_path / "recipe.yaml").given_lateral_pull_m is not None
    text = (REPOSITORY / "docs/deployment.md").read_text()
    lines = [line for line in text.splitlines() if line.startswith("{")]
    samples = [line for line in lines if "bend_deg" not in line]
    assert len(samples) >= 2
    for line in samples:
        SampleLine.model_validate(parse_json_object(line))
    for line in set(lines) - set(samples):
        assert json.loads(line).keys() == {"time_s", "bend_deg", "interval_deg", "source", "health"}


def test_small_sizes_leave_every_other_word_as_printed():
    """A pattern that matched too much would run something else than what is printed."""
    for snippet in COMMANDS:
        if snippet.text.startswith("endotwin"):
            printed, small = words_of(snippet.text), words_of(snippet.small)
            assert small[1] == printed[1]
            flags = {word for word in printed if word.startswith("--")} - {"--suite", "--starts"}
            assert flags <= set(small), snippet.name
