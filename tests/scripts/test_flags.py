"""Messages of the library in the words of the command line."""

import dataclasses

import pytest

from scripts.command import with_flags


@dataclasses.dataclass(frozen=True)
class Verb:
    command_unit: str = "mm"
    pace: float = 1.0


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("pace = 0: must be positive", "--pace 0: must be positive"),
        (
            "a.csv line 3: check `command_unit` and `pulley_radius`",
            "a.csv line 3: check --command-unit and --pulley-radius-mm",
        ),
        ("address = tcp: must be as in tcp://a:1", "--dask tcp: must be as in tcp://a:1"),
        (
            "a.mcap is cut off; `recover_episode` saves what is whole",
            "a.mcap is cut off; `endotwin export FILE --recover` saves what is whole",
        ),
        ("runs holds a run: choose another `folder`", "runs holds a run: choose another --out"),
        ("preset parameter pace = 0: must be positive", "preset parameter pace = 0: must be positive"),
        ("discount = 2: must be at most 1", "discount = 2: must be at most 1"),
        ("parameters need a `name` among them", "parameters need a `name` among them"),
    ],
)
def test_parameters_of_the_library_become_flags_of_the_verb(said, shown):
    assert with_flags(said, Verb()) == shown


def test_without_a_verb_only_the_table_is_known():
    assert with_flags("check `command_unit`; `recover_episode` may help").endswith("--recover` may help")
    assert with_flags("pace = 0") == "pace = 0"
