"""Common run of all verbs: the command line is parsed, the verb works, its summary is printed.

Nothing heavy is imported here or at the top of a verb's file: `--help` answers at once. A verb imports what
it needs when it runs.
"""

import contextlib
import dataclasses
import io
import itertools
import json
import logging
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from scripts.ending import (
    MISTAKE,
    complain,
    described,
    exit_status,
    flush_stdout,
    one_line,
    prepare_streams,
    say,
    stop_by_signals,
)
from scripts.outputs import keep_folders, remove_empty_folders
from scripts.progress import Progress
from twin.errors import InputError

Arguments = TypeVar("Arguments")
MODULES = {"import": "import_log"}
"""Module of each verb that cannot name one: `import` is a word of Python."""
SPOKEN = {
    "address": "--dask",
    "folder": "--out",
    "pulley_radius": "--pulley-radius-mm",
    "recorded_variance": "--sensor-variance",
    "recover_episode": "`endotwin export FILE --recover`",
    "reverse_angle": "--reverse-angle",
    "reverse_lateral_angle": "--reverse-lateral-angle",
}
"""Names of the library that a command line spells otherwise, or that belong to another verb."""


@dataclasses.dataclass(frozen=True)
class Summary:
    """Summary of a verb."""

    line: str
    """One sentence for a person."""
    values: dict[str, Any]
    """The same for a program: printed as one JSON object by `--json`."""
    code: int = 0
    """Exit code of the command."""
    table: str = ""
    """Table for a person, printed before the sentence."""
    to_stderr: bool = False
    """Print it on stderr: stdout is a stream of something else."""


def run_verb(
    arguments: Callable[..., Arguments],
    verb: Callable[[Arguments], Summary],
    argv: Sequence[str] | None = None,
) -> int:
    """Parse the command line, run a verb and print its summary; returns the exit code.

    A user's mistake (a wrong value, file or folder) is one line on stderr and exit code 2, without a
    traceback.
    """
    module = verb.__module__.rsplit(".", 1)[-1]
    word = next((word for word, name in MODULES.items() if name == module), module)
    name = f"endotwin {word}" if module != "__main__" else sys.argv[0]
    logging.getLogger("absl").setLevel(logging.ERROR)  # dm_control repeats there what we raise
    prepare_streams()
    parsed = _parse(arguments, name, argv)
    if parsed is None:
        return MISTAKE
    try:
        with stop_by_signals():
            seed = getattr(parsed, "seed", None)
            if seed is not None and seed < 0:
                raise InputError(f"--seed {seed}: must not be negative")
            summary = verb(parsed)
    except (Exception, KeyboardInterrupt) as error:
        Progress.close_all()  # the line about the mistake is the last
        remove_empty_folders()
        complain(f"{name}: {with_flags(described(error), parsed)}")
        return exit_status(error)
    keep_folders()
    return _tell(name, summary, as_json=getattr(parsed, "json", False))


def _tell(name: str, summary: Summary, *, as_json: bool) -> int:
    """Print a summary; returns the exit code."""
    if summary.table:
        say(summary.table, sys.stderr if as_json else sys.stdout)
    stream = sys.stderr if summary.to_stderr else None
    if not say(json.dumps(summary.values) if as_json else summary.line, stream):
        complain(f"{name}: the summary cannot be written to standard output; what was made is whole")
        return MISTAKE
    return summary.code


def _parse(arguments: Callable[..., Arguments], name: str, argv: Sequence[str] | None) -> Arguments | None:
    """Parse the command line; of a mistake, print what tyro says in its box as one line and return None."""
    import tyro  # here, so that what needs no command line does not wait for it

    if not all(word.strip() for word in (sys.argv[1:] if argv is None else argv)):
        complain(f"{name}: an argument is empty: is a variable not set?")
        return None
    printed = io.StringIO()
    try:
        with contextlib.redirect_stderr(printed):
            return tyro.cli(arguments, prog=name, args=argv, description=arguments.__doc__)
    except BrokenPipeError:  # who asked for help has gone
        raise SystemExit(0) from None
    except SystemExit as end:
        if not end.code:
            flush_stdout()
            raise
    inside = [line.strip("│╭╰╮╯ ") for line in printed.getvalue().splitlines()[1:]]
    said = itertools.dropwhile(_is_rule, inside)  # the box has lines of dashes where there is no Unicode
    message = " ".join(itertools.takewhile(lambda line: not _is_rule(line), said))
    wrong = re.search(
        r"Error parsing (\S+): no type matching {None}\|{(.+?)} could .*? from (\[.*?\])", message
    )
    if wrong:
        message = "{0} {2}: must be {1}".format(*wrong.groups())
    complain(f"{name}: {one_line(message, 200)} (`{name} --help` lists the options)")
    return None


def _is_rule(line: str) -> bool:
    return bool(line) and not line.strip("─-")


def with_flags(line: str, arguments: Any = None) -> str:
    """Replace parameters of the library in a message, `name` or a leading `name = value`, by flags."""
    flags = SPOKEN | {
        field.name: "--" + field.name.replace("_", "-")
        for field in (dataclasses.fields(arguments) if arguments else ())
    }
    line = re.sub(r"^(\w+) = ", lambda found: f"{flags.get(found[1], found[1] + ' =')} ", line)
    return re.sub(r"`(\w+)`", lambda found: flags.get(found[1], found[0]), line)
