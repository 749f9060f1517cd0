"""No file, link, folder or option does harm to any verb, and none that is killed loses anything.

A case alone: HOSTILE='command|family|target|what|seed' in the environment. `make endurance` runs thousands.
"""

import disturbed
import hostile_cases
import hostile_edits
import numpy as np
import pytest
from workspace import COMMANDS

QUICK = [name for name, command in COMMANDS.items() if not command.slow]
KILLED = ["generate", "import", "export mcap", "run", "calibrate", "train", "evaluate", "report"]


def few_and_many(few: int, many: int) -> list:
    return [few, pytest.param(many, marks=pytest.mark.endurance)]


@pytest.mark.parametrize("count", [*few_and_many(4, 3000), pytest.param(16, marks=pytest.mark.slow)])
def test_hostile_files_end_in_good_output_or_one_line(workspace, tmp_path, count):
    commands = QUICK if count < 100 else list(COMMANDS)
    hostile_cases.run_all(hostile_cases.drawn(count, workspace, commands), workspace, tmp_path)


@pytest.mark.parametrize("count", few_and_many(16, 240))
def test_extreme_numbers_end_in_good_output_or_one_line_that_names_the_file(workspace, tmp_path, count):
    commands = QUICK if count < 100 else list(COMMANDS)
    hostile_cases.run_all(hostile_cases.numbers(count, workspace, commands), workspace, tmp_path)


@pytest.mark.parametrize("count", few_and_many(20, 2000))
def test_hostile_options_end_in_good_output_or_one_line(workspace, tmp_path, count):
    commands = QUICK if count < 100 else list(COMMANDS)
    hostile_cases.run_all(hostile_cases.arguments(count, commands), workspace, tmp_path)


@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.endurance)])
def test_a_pickle_in_any_file_that_a_verb_reads_is_never_loaded(workspace, tmp_path, every):
    hostile_cases.run_all(hostile_cases.pickles(workspace, every=every), workspace, tmp_path)


def test_every_kind_of_damage_can_be_done(workspace, tmp_path):
    files = [workspace / name for name in ("recipe.yaml", "log.csv", "data/train/dataset.json")]
    for path in (*files, workspace / "runs/ram/policy.onnx"):
        for name, edit in hostile_edits.edits_of(path).items():
            for seed in range(2):
                assert isinstance(edit(np.random.default_rng(seed), path.read_bytes()), bytes), name


@pytest.mark.endurance  # `tests/dataset/test_interrupted.py` kills `generate` in every run of the tests
def test_a_killed_command_ends_in_the_same_bytes_when_it_runs_again(workspace, tmp_path):
    wholes = {name: disturbed.Undisturbed(name, workspace, tmp_path) for name in KILLED}
    found = []
    for seed in range(300):
        name = KILLED[(seed + seed // 3) % len(KILLED)]  # so that each signal meets each command
        found += disturbed.faults_of_a_kill(name, wholes[name], seed, workspace, tmp_path)
    assert not found, "\n".join(found)


@pytest.mark.endurance
def test_a_full_disk_is_one_line_and_the_same_command_goes_on(workspace, tmp_path, small_disk):
    wholes = {name: disturbed.Undisturbed(name, workspace, tmp_path) for name in KILLED}
    found = []
    for seed in range(60):
        name = KILLED[seed % len(KILLED)]
        found += disturbed.faults_of_a_full_disk(name, wholes[name], seed, workspace, small_disk)
    assert not found, "\n".join(found)
