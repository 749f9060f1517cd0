"""Eight of the same command at once into one folder: all are listed, or refused in one line."""

import json

import disturbed
import pytest
from built_workbench import one_place
from hostile_runs import job

ROUNDS = [1, pytest.param(20, marks=pytest.mark.endurance)]
AT_ONCE = 8


def assert_whole_or_one_line(ended) -> None:
    for run in ended:
        assert not run.stopped
        assert "Traceback" not in run.err
        assert run.code in (0, 2), run.err
        if run.code == 2:
            assert len(run.said) == 1
            assert len(run.said[0]) <= 300
    assert any(run.code == 0 for run in ended)


@pytest.mark.parametrize("rounds", ROUNDS)
@pytest.mark.parametrize("folder", ["made", "measured"])
def test_imports_at_once_are_all_listed_or_refused(workbench, runner, rounds, folder):
    for _ in range(rounds):
        with one_place(workbench.root) as place:
            jobs = disturbed.processes_of([], place, AT_ONCE)
            for k, one in enumerate(jobs):
                one["words"] = f"import log.csv --name log_{k} --out {folder}".split()
            ended = runner.run(*jobs)
            assert_whole_or_one_line(ended)
            listed = json.loads((place.work / folder / "dataset.json").read_text())["files"]
            written = {f"log_{k}.mcap" for k, run in enumerate(ended) if run.code == 0}
            names = {entry["name"] if isinstance(entry, dict) else entry for entry in listed}
            assert written <= names
            assert {path.name for path in (place.work / folder).glob("*.mcap")} == {
                n for n in names if n.endswith(".mcap")
            }
            assert_clean(place, runner, folder)
            (later,) = runner.run(job(f"import log.csv --name later --out {folder}".split(), place))
            assert later.code == 0, later.err


@pytest.mark.parametrize("rounds", ROUNDS)
def test_generates_at_once_make_one_dataset(workbench, runner, rounds):
    for _ in range(rounds):
        with one_place(workbench.root) as place:
            ended = runner.run(
                *disturbed.processes_of(["generate", "recipe.yaml", "--out", "made"], place, AT_ONCE)
            )
            assert_whole_or_one_line(ended)
            assert_clean(place, runner, "made")
            alone = {path.name: path.read_bytes() for path in (place.work / "data" / "train").iterdir()}
            assert {path.name: path.read_bytes() for path in (place.work / "made").iterdir()} == alone


@pytest.mark.parametrize("rounds", ROUNDS)
def test_exports_at_once_make_one_folder(workbench, runner, rounds):
    for _ in range(rounds):
        with one_place(workbench.root) as place:
            ended = runner.run(
                *disturbed.processes_of(["export", "data/train", "--out", "made"], place, AT_ONCE)
            )
            assert_whole_or_one_line(ended)
            assert not [path.name for path in place.work.iterdir() if "partial" in path.name]


def assert_clean(place, runner, folder: str) -> None:
    (verified,) = runner.run(job(f"generate --verify --out {folder}".split(), place))
    assert verified.code == 0, verified.err
