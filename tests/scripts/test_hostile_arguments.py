"""No argument does harm: a mistake is one line, said before anything is touched.

`make endurance` runs thousands. One case alone: HOSTILE='command|argument|-|drawn|seed' and this file.
"""

import hostile_arguments
import hostile_cases
import pytest


@pytest.mark.parametrize("count", [50, pytest.param(2000, marks=pytest.mark.endurance)])
def test_hostile_arguments_end_in_good_output_or_one_line(workbench, runner, count):
    cases = [*hostile_cases.argument_cases(count, quick=count < 1000)]
    tally = hostile_cases.run_all(cases, workbench, runner)
    print(tally.table())
    assert not tally.faults(), tally.report()


def test_options_are_found_without_a_list():
    assert {"recipe", "out", "seconds", "dask"} <= {*hostile_arguments.options_of("generate")}
    assert {"file", "out", "time_column"} <= {*hostile_arguments.options_of("import")}
