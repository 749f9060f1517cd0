"""Common parts of all verbs: parsing, one line for a mistake, one line of summary, progress on stderr.

Nothing heavy is imported here or at the top of a verb's file: `--help` answers at once. A verb imports what
it needs when it runs.
"""

import contextlib
import dataclasses
import io
import itertools
import json
import logging
import os
import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from twin.errors import MissingExtraError, missing_extra

if TYPE_CHECKING:
    from tqdm import tqdm

Arguments = TypeVar("Arguments")
MISTAKE = 2
MODULES = {"import": "import_log"}
"""Module of each verb that cannot name one: `import` is a word of Python."""
SPOKEN = {
    "address": "--dask",
    "folder": "--out",
    "pulley_radius": "--pulley-radius-mm",
    "recorded_variance": "--sensor-variance",
    "recover_episode": "`endotwin export FILE --recover`",
    "reverse_angle": "--reverse-angle",
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
    parsed = _parse(arguments, name, argv)
    if parsed is None:
        return MISTAKE
    try:
        seed = getattr(parsed, "seed", None)
        if seed is not None and seed < 0:
            raise ValueError(f"--seed {seed}: must not be negative")
        summary = verb(parsed)
    except ImportError as error:
        missing = error if isinstance(error, MissingExtraError) else missing_extra(error)
        if missing is None:
            raise
        Progress.close_all()
        print(f"{name}: {missing}", file=sys.stderr)
        return MISTAKE
    except (ValueError, OSError, ArithmeticError, MemoryError, BrokenExecutor) as error:
        Progress.close_all()  # the line about the mistake is the last
        print(f"{name}: {with_flags(_one_line(error), parsed)}", file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt as stop:
        Progress.close_all()
        print(f"{name}: stopped{stop}", file=sys.stderr)
        return 130
    if getattr(parsed, "json", False):
        print(json.dumps(summary.values))
    else:
        print(summary.line)
    return summary.code


def _parse(arguments: Callable[..., Arguments], name: str, argv: Sequence[str] | None) -> Arguments | None:
    """Parse the command line; of a mistake, print what tyro says in its box as one line and return None."""
    import tyro  # here, so that what needs no command line does not wait for it

    if "" in (sys.argv[1:] if argv is None else argv):
        print(f"{name}: an argument is empty: is a variable not set?", file=sys.stderr)
        return None
    printed = io.StringIO()
    try:
        with contextlib.redirect_stderr(printed):
            return tyro.cli(arguments, prog=name, args=argv, description=arguments.__doc__)
    except SystemExit as end:
        if not end.code:
            raise
    inside = [line.strip("│╭╰╮╯ ") for line in printed.getvalue().splitlines()[1:]]
    said = itertools.dropwhile(_is_rule, inside)  # the box has lines of dashes where there is no Unicode
    message = " ".join(itertools.takewhile(lambda line: not _is_rule(line), said))
    wrong = re.search(
        r"Error parsing (\S+): no type matching {None}\|{(.+?)} could .*? from (\[.*?\])", message
    )
    if wrong:
        message = "{0} {2}: must be {1}".format(*wrong.groups())
    print(f"{name}: {message} (`{name} --help` lists the options)", file=sys.stderr)
    return None


def _is_rule(line: str) -> bool:
    return bool(line) and not line.strip("─-")


def output_folder(path: Path) -> Path:
    """Make a folder and prove that it can be written, before any long work.

    Raises:
        ValueError: it cannot be made or written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise ValueError(f"cannot write to the folder {path}: {os.strerror(error.errno or 0)}") from error
    return path


def output_file(path: Path, suffixes: Sequence[str] = ()) -> Path:
    """Make the folder of a file and prove that it can be written.

    Raises:
        ValueError: the folder cannot be written, the path is a folder, or its suffix is none of `suffixes`.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise ValueError(f"--out {path}: must end in {' or '.join(suffixes)}")
    if path.is_dir():
        raise ValueError(f"--out {path} is a folder: name a file")
    output_folder(path.parent)
    return path


class Progress:
    """A bar on stderr that is told how far the work is: `Progress("training")(done, total, note)`."""

    _shown: ClassVar[list["tqdm[Any]"]] = []

    def __init__(self, what: str, unit: str = ""):
        self.bar: tqdm[Any] | None = None
        self.what = what
        self.unit = unit

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Show that `done` of `total` are done."""
        if self.bar is None:
            from tqdm import tqdm

            self.bar = tqdm(
                total=total, desc=self.what, unit=self.unit or "it", file=sys.stderr, unit_scale=True
            )
            self._shown.append(self.bar)
        if note:
            self.bar.set_postfix_str(note, refresh=False)
        self.bar.update(done - self.bar.n)
        if done >= total:
            self.bar.close()

    @classmethod
    def close_all(cls) -> None:
        """Leave every bar as it stands, each on a line of its own."""
        while cls._shown:
            cls._shown.pop().close()


class TrainingProgress(Progress):
    """A bar that is told the mean reward too, and shows it as the error that it is."""

    def __call__(self, done: int, total: int, reward: float | str = "") -> None:
        """Show that `done` of `total` are done, at a mean reward per sample [deg^2]."""
        note = reward if isinstance(reward, str) else f"mean square error {-reward:.3f} deg^2"
        super().__call__(done, total, note)


def _one_line(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split()) or type(error).__name__


def with_flags(line: str, arguments: Any = None) -> str:
    """Replace parameters of the library in a message, `name` or a leading `name = value`, by flags."""
    flags = SPOKEN | {
        field.name: "--" + field.name.replace("_", "-")
        for field in (dataclasses.fields(arguments) if arguments else ())
    }
    line = re.sub(r"^(\w+) = ", lambda found: f"{flags.get(found[1], found[1] + ' =')} ", line)
    return re.sub(r"`(\w+)`", lambda found: flags.get(found[1], found[0]), line)
