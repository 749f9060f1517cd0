"""The guide and the glossary point at files that exist, and the hooks at commands that do."""

import re
import shutil
import sys
from pathlib import Path

import pytest
import yaml
from source_tree import ROOT

PATH = re.compile(r"`((?:twin|rl|scripts|tests|assets|docs)/[\w./-]*)`")


@pytest.mark.parametrize("document", ["CONTRIBUTING.md", "docs/glossary.md"])
def test_every_file_that_is_named_is_there(document):
    text = (ROOT / document).read_text()
    named = {path for path in PATH.findall(text) if not re.search("VERB|NAME", path)}
    assert len(named) > 10
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]
    linked = {target for target in re.findall(r"\]\(([\w./]+)\)", text)}
    assert not [path for path in linked if not (ROOT / document).parent.joinpath(path).exists()]


def test_the_hooks_run_what_the_environment_has():
    configuration = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    (repository,) = configuration["repos"]
    assert repository["repo"] == "local"
    commands = {hook["entry"].split()[0] for hook in repository["hooks"]}
    assert commands == {"ruff", "mypy"}
    for command in commands:
        assert shutil.which(command, path=Path(sys.executable).parent)
