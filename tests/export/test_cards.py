"""The cards of datasets, and the lines in them that load a dataset: they run from its folder."""

import re
import subprocess
import sys

import pytest
from repository import ENVIRONMENT

PYTHON = re.compile(r"```python\n(.*?)```", re.DOTALL)


@pytest.fixture(scope="module")
def exported(whole_dataset, tmp_path_factory):
    folder = tmp_path_factory.mktemp("cards") / "lerobot"
    from twin.export.export import Plan, export_records, named_files

    folder.mkdir()
    export_records(named_files((whole_dataset,)), folder, Plan("parquet"))
    return folder


@pytest.mark.parametrize("place", ["dataset", pytest.param("export", marks=pytest.mark.slow)])
def test_every_snippet_of_a_card_runs_in_its_folder(whole_dataset, exported, place):
    folder = {"dataset": whole_dataset, "export": exported}[place]
    snippets = PYTHON.findall((folder / "README.md").read_text())
    assert len(snippets) == {"dataset": 1, "export": 3}[place]
    for code in snippets:
        if "lerobot" in code:
            compile(
                code, "card", "exec"
            )  # LeRobot brings gigabytes; docs/dataset.md says with which it was tried
            continue
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, env=ENVIRONMENT
        )
        assert done.returncode == 0, done.stderr[-800:]
        assert done.stdout
        assert len([line for line in code.splitlines() if line and "import" not in line]) <= 5


@pytest.mark.slow
def test_the_commands_of_a_card_run_in_its_folder(dataset_copy):
    text = (dataset_copy / "README.md").read_text()
    commands = re.findall(r"^(endotwin [^#\n]*[^#\s])", text, re.MULTILINE)
    assert [command.split()[1] for command in commands] == ["export", "generate", "generate", "generate"]
    for command in commands:
        done = subprocess.run(
            [sys.executable, "-m", "scripts", *command.split()[1:]],
            cwd=dataset_copy,
            capture_output=True,
            text=True,
            env=ENVIRONMENT,
        )
        assert done.returncode == 0, f"{command}\n{done.stderr[-800:]}"
    assert (dataset_copy.parent / "lerobot/meta/info.json").is_file()
    again = (dataset_copy.parent / "again/dataset.json").read_text()
    assert again.count("sha256") == (dataset_copy / "dataset.json").read_text().count("sha256")
