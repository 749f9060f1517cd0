"""No file that any verb reads does harm, whatever is in it, in its place, or beside what the verb writes.

`make endurance` runs thousands. One case alone: HOSTILE='command|family|target|what|seed' and this file.
"""

import hostile_cases
import pytest


@pytest.mark.parametrize("count", [60, pytest.param(3000, marks=pytest.mark.endurance)])
def test_hostile_files_end_in_good_output_or_one_line(workbench, runner, count):
    cases = [*hostile_cases.file_cases(workbench, count, quick=count < 1000)]
    tally = hostile_cases.run_all(cases, workbench, runner)
    print(tally.table())
    assert not tally.faults(), tally.report()


@pytest.mark.parametrize("each", [False, pytest.param(True, marks=pytest.mark.endurance)])
def test_a_pickle_in_any_file_that_a_verb_reads_is_never_loaded(workbench, runner, each):
    cases = [*hostile_cases.pickle_cases(workbench, each)]
    tally = hostile_cases.run_all(cases, workbench, runner)
    print(tally.table())
    assert not tally.faults(), tally.report()


def test_tracing_finds_what_a_verb_reads(workbench):
    """Were it to find nothing, nothing would be tried; these are read by Python, and by native code."""
    assert {"data/train/dataset.json", "data/train/episode_0000.mcap"} <= {*workbench.traces["verify"].reads}
    assert {"recipe.yaml", "small.yaml"} <= {*workbench.traces["generate"].reads}
    assert "runs/ram/policy.onnx" in workbench.traces["evaluate"].reads
    assert any("calibration" in name for name in workbench.traces["calibrate again"].reads)
    assert any("checkpoint" in name for name in workbench.traces["train again"].reads)
