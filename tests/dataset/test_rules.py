"""Each rule of a verification is named by what breaks it."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from small_dataset import SECOND

from twin.dataset.verify import RULES, RuleFault, verify
from twin.files.bounded import sha256_of


def stated(change: Callable[[dict], object]) -> Callable[[Path], None]:
    """Change `dataset.json`."""

    def break_it(folder: Path) -> None:
        path = folder / "dataset.json"
        contents = json.loads(path.read_text())
        change(contents)
        path.write_text(json.dumps(contents))

    return break_it


def cut_off(folder: Path) -> None:
    """Half a file, whose hash dataset.json states."""
    path = folder / SECOND
    path.write_bytes(path.read_bytes()[:1000])

    def change(contents: dict) -> None:
        contents["bytes"] += 1000 - contents["files"][1]["bytes"]
        contents["files"][1].update(sha256=sha256_of(path), bytes=1000)

    stated(change)(folder)


def fewer_quantities(contents: dict) -> None:
    contents["features"]["truth_deg"]["meaning"] = "something else"


BREAKS = {
    "files": lambda folder: (folder / SECOND).unlink(),
    "bytes": stated(lambda contents: contents["files"][1].update(sha256=64 * "0")),
    "readable": cut_off,
    "length": stated(lambda contents: contents["files"][1].update(samples=3)),
    "quantities": stated(fewer_quantities),
    "statistics": stated(lambda contents: contents["files"][1]["statistics"]["truth_deg"].update(mean=99.0)),
    "origin": stated(lambda contents: contents["files"][1].update(signal="triangles")),
    "recipe": lambda folder: (folder / "recipe.yaml").unlink(),
    "totals": stated(lambda contents: contents.update(seconds=1e3)),
    "tables": lambda folder: (folder / "episode_0001.csv").write_text("x\n"),
    "card": lambda folder: (folder / "README.md").unlink(),
}


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_is_named_by_what_breaks_it(dataset_copy, rule):
    BREAKS[rule](dataset_copy)
    faults, _ = verify(dataset_copy)
    assert rule in {fault.rule for fault in faults}, faults


def test_a_fault_is_its_line():
    fault = RuleFault("files", "a is missing")
    assert fault == "a is missing"
    assert json.dumps([fault]) == '["a is missing"]'
    assert fault.rule in RULES
