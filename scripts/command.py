"""Common steps of all verbs: parse the command line, work, print the summary, and end with an exit code.

Any input leads to a summary on stdout, or to one line on stderr that is no longer than `LONGEST_LINE`.
ENDOTWIN_TRACEBACK=1 shows where an error comes from. Heavy packages are imported when a verb runs, not at the
top of its file: `--help` answers at once.
"""

import contextlib
import dataclasses
import io
import itertools
import json
import logging
import os
import re
import shlex
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from types import FrameType
from typing import Any, TextIO, TypeVar

from scripts.help_text import help_of, is_positional
from scripts.outputs import keep_folders, remove_empty_folders
from scripts.progress import Progress
from twin.errors import InputError, MissingExtraError, missing_extra
from twin.files.program import program_at_fault

Arguments = TypeVar("Arguments")
MISTAKE = 2  # exit status of a command that cannot do its work
LONGEST_LINE = 300  # characters of the line that states why
MODULES = {"import": "import_log"}
"""Module of each verb that cannot name one: `import` is a keyword of Python."""
EXPECTED_ERRORS = (ValueError, OSError, ArithmeticError, MemoryError, BrokenExecutor)
"""Errors whose text is for the user; any other is a fault of the program."""
FLAGS = {
    "address": "--dask",
    "folder": "--out",
    "pulley_radius": "--pulley-radius-mm",
    "recorded_variance": "--sensor-variance",
    "recover_episode": "`endotwin export FILE --recover`",
    "reverse_angle": "--reverse-angle",
    "reverse_lateral_angle": "--reverse-lateral-angle",
}
"""Parameters of the library whose flag has another name, or belongs to another verb."""

_NO_MEMORY = re.compile("failed to map segment|cannot allocate memory", re.IGNORECASE)
"""Text of the loader's error where the memory for a library is missing; NumPy puts its own around it."""
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


@dataclasses.dataclass(frozen=True)
class Summary:
    """Summary of a verb: a sentence, or `values` as JSON; `table` stands before the sentence.

    `to_stderr` is for a verb whose stdout is a stream.
    """

    line: str
    values: dict[str, Any]
    code: int = 0
    table: str = ""
    to_stderr: bool = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """Options of every verb."""

    json: bool = False
    """Print the summary as one JSON object."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SeedIgnored(Options):
    """Options of a verb that draws nothing."""

    seed: int = 0
    """Without effect: the result does not depend on a seed."""


def options_of(settings: type, args: Any) -> dict[str, Any]:
    """Return the options that are fields of `settings` too, a dataclass."""
    names = [field.name for field in dataclasses.fields(settings)]
    return {name: getattr(args, name) for name in names if hasattr(args, name)}


def compile_once(command: str, preset: Any = None) -> None:
    """Compile the reduced twin for a preset, or for one bending plane, before workers would, each."""
    import numpy as np

    from twin.mechanics.kernels import on_compile
    from twin.preset.file import load_preset
    from twin.reduced import simulate

    preset = preset or load_preset("ureteroscope")
    with on_compile(lambda: complain(f"{command}: compiling the reduced twin, once: some seconds")):
        simulate(preset, np.full(2, preset.command_zeros[0]), preset.control_period)


def run_verb(
    arguments: type[Arguments],
    verb: Callable[[Arguments], Summary],
    argv: Sequence[str] | None = None,
) -> int:
    """Parse the command line, run a verb and print its summary; returns the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    module = verb.__module__.rsplit(".", 1)[-1]
    word = next((word for word, name in MODULES.items() if name == module), module)
    name = f"endotwin {word}" if module != "__main__" else sys.argv[0]
    for logger in ("absl", "matplotlib"):  # dm_control repeats what we raise; a cache without a home folder
        logging.getLogger(logger).setLevel(logging.ERROR)
    prepare_streams()
    if {"-h", "--help"} & {*argv}:
        if say(help_of(arguments, name)):
            return 0
        complain(f"{name}: the help cannot be written: is a disk full?")
        return MISTAKE
    parsed = _parse(arguments, name, argv)
    if parsed is None:
        return MISTAKE
    try:
        with _stop_by_signals():
            seed = getattr(parsed, "seed", None)
            if seed is not None and seed < 0:
                raise InputError(f"--seed {seed}: must not be negative")
            summary = verb(parsed)
    except (Exception, KeyboardInterrupt) as error:
        Progress.close_all()  # the line about the mistake is the last
        remove_empty_folders()
        complain(f"{name}: {with_flags(describe_error(error), parsed)}")
        return exit_status(error)
    keep_folders()
    as_json = getattr(parsed, "json", False)
    shown = not summary.table or say(summary.table, sys.stderr if as_json else sys.stdout)
    text = json.dumps(summary.values) if as_json else summary.line
    if not (say(text, sys.stderr if summary.to_stderr else None) and shown):
        complain(f"{name}: the summary cannot be written to standard output; the results are complete")
        return MISTAKE
    return summary.code


def _parse(arguments: type[Arguments], name: str, argv: Sequence[str]) -> Arguments | None:
    """Parse the command line; after a mistake, print tyro's message as one line and return None."""
    import tyro

    if not all(word.strip() for word in argv):
        complain(f"{name}: an argument is empty: is a variable not set?")
        return None
    printed = io.StringIO()
    try:
        with contextlib.redirect_stderr(printed):
            return tyro.cli(arguments, prog=name, args=argv, config=(tyro.conf.FlagCreatePairsOff,))
    except SystemExit as end:
        if not end.code:  # a script that completes commands in a shell
            raise
    inside = [line.strip("│╭╰╮╯ ") for line in printed.getvalue().splitlines()[1:]]
    box = itertools.dropwhile(_is_rule, inside)  # lines of dashes where there is no Unicode
    message = " ".join(itertools.takewhile(lambda line: not _is_rule(line), box))
    kinds = r"Error parsing (\S+): no type matching {None}\|{(.+?)} could .*? from (\[.*?\])"
    if wrong := re.search(kinds, message):
        message = "{0} {2}: must be {1}".format(*wrong.groups())
    if wrong := re.search(r"invalid choice (\S+) for argument '(\S+?)'\. Expected one of \((.*?)\)", message):
        valid = sorted(set(re.findall(r"'([^']*)'", wrong[3])) - {"None"})
        message = f"{wrong[2].split('/')[-1]} {wrong[1]}: must be one of {', '.join(valid)}"
    complain(f"{name}: {one_line(message, 200)} (`{name} --help` lists the options)")
    return None


def _is_rule(line: str) -> bool:
    return bool(line) and not line.strip("─-")


def with_flags(line: str, arguments: Any = None) -> str:
    """Replace parameters of the library in a message, `name` or a leading `name = value`, by flags.

    A leading `sensor name = value` is of the sensor's parameters, whose flags begin with `--sensor-`.
    """
    names = [field.name for field in dataclasses.fields(arguments)] if arguments else []
    flags = FLAGS | {name: "--" + name.replace("_", "-") for name in names}
    sensor = re.match(r"sensor (\w+) = ", line)
    if sensor and (flag := flags.get(f"sensor_{sensor[1]}")):
        return f"{flag} {line[sensor.end() :]}"
    line = re.sub(r"^(\w+) = ", lambda found: f"{flags.get(found[1], found[1] + ' =')} ", line)
    return re.sub(r"`(\w+)`", lambda found: flags.get(found[1], found[0]), line)


def command_line(verb: str, args: Any) -> str:
    """Return the command line that repeats a verb: what differs from the defaults, and the seed.

    Options that no result depends on are left out.
    """
    positional: list[str] = []
    flags: list[str] = []
    for field in dataclasses.fields(args):
        value = getattr(args, field.name)
        if field.name in ("out", "workers", "dask", "json") or value is None:
            continue
        if is_positional(field.type):
            positional += _words(value)
        elif field.name == "seed" or value != field.default:
            flag = f"--{field.name.replace('_', '-')}"
            flags += [flag] if value is True else [flag, *_words(value)]
    return shlex.join(["endotwin", verb, *positional, *flags])


def _words(value: Any) -> list[str]:
    if isinstance(value, tuple | list):
        return [word for part in value for word in _words(part)]
    return [repr(value).removesuffix(".0") if isinstance(value, float) else str(value)]


# Output


def one_line(text: str, longest: int = LONGEST_LINE) -> str:
    """Return text on one line of printable characters, its middle cut out where it is too long."""
    words = " ".join(text.split())
    line = "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in words)
    if len(line) <= longest:
        return line
    end = longest // 3
    return f"{line[: longest - end - 5]} ... {line[-end:]}"


def complain(line: str) -> None:
    """Print one line on stderr, as far as that can be written."""
    with contextlib.suppress(OSError, ValueError):
        print(one_line(line), file=sys.stderr, flush=True)


def say(text: str, stream: TextIO | None = None) -> bool:
    """Print text on stdout or another stream; returns False where it cannot be written, as on a full disk.

    A closed pipe is no failure: its reader has seen enough.
    """
    try:
        print(text, file=stream or sys.stdout, end="\n" if text else "", flush=True)
    except BrokenPipeError:
        _discard_stdout()
    except (OSError, ValueError):
        _discard_stdout()
        return False
    return True


def stream_line(line: str) -> bool:
    """Write one line of a stream to stdout; returns False where its reader has gone."""
    try:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        _discard_stdout()
        return False
    except OSError as error:
        _discard_stdout()
        raise _unwritable(error) from error
    return True


def _unwritable(error: OSError) -> OSError:
    return OSError(error.errno, error.strerror, "standard output")


def _discard_stdout() -> None:
    """Redirect stdout, so that Python does not try to write the rest of its buffer at exit."""
    with contextlib.suppress(OSError, ValueError, io.UnsupportedOperation):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def prepare_streams() -> None:
    """Open stdout and stderr where they are closed, and escape characters that they cannot show."""
    with contextlib.suppress(OSError):
        # A file that is opened later must not get the descriptor of a closed stream: messages would go there.
        while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
            pass
        os.close(descriptor)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115  open as long as the process
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


# Errors and signals


class Stopped(KeyboardInterrupt):
    """A signal that asks the command to end: it cleans up first."""


class _Signal:
    """The signal that has asked for the end, and whether it waits for the end of a step."""

    number: int | None = None
    waits = False


class UninterruptedStep:
    """Context manager: a signal that comes within the block ends the command after it."""

    def __enter__(self) -> None:
        _Signal.waits = True

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Let signals end the command again; raise one that has come meanwhile."""
        _Signal.waits = False
        if _Signal.number is not None and kind is None:
            raise Stopped


def leave_at_once(number: int, frame: FrameType | None = None) -> None:
    """Handle a signal where there is nothing to clean up."""
    with contextlib.suppress(OSError):
        os.write(2, b"endotwin: stopped\n")
    os._exit(128 + number)


@contextlib.contextmanager
def signals_handled_by(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Context manager: SIGINT, SIGTERM and SIGHUP call `handler`."""
    if threading.current_thread() is not threading.main_thread():  # Python handles signals only there
        yield
        return
    before = {number: signal.signal(number, handler) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


@contextlib.contextmanager
def _stop_by_signals() -> Iterator[None]:
    """Context manager: a signal ends the block by an exception, so that it cleans up; a second, at once."""
    _Signal.number, _Signal.waits = None, False
    hook, sys.unraisablehook = sys.unraisablehook, _deliver_again
    try:
        with signals_handled_by(_stop):
            yield
    finally:
        sys.unraisablehook = hook


def _stop(number: int, frame: FrameType | None) -> None:
    if _Signal.number is not None:
        leave_at_once(number)
    _Signal.number = number
    if not _Signal.waits:
        raise Stopped


def _deliver_again(unraisable: Any) -> None:
    """Send a signal once more whose exception came where none can pass, as in a callback from C."""
    if isinstance(unraisable.exc_value, Stopped):
        number, _Signal.number = _Signal.number, None
        threading.Timer(0.05, os.kill, (os.getpid(), number)).start()
    else:
        sys.__unraisablehook__(unraisable)


def _is_stop(error: BaseException) -> bool:
    """Return whether a signal caused an exception: libraries may have turned it into another one."""
    return isinstance(error, KeyboardInterrupt) or _Signal.number is not None


def exit_status(error: BaseException) -> int:
    """Return the exit status for an exception that ends a command."""
    return 128 + (_Signal.number or signal.SIGINT) if _is_stop(error) else MISTAKE


def describe_error(error: BaseException) -> str:
    """Return on one line why a command ends."""
    if os.environ.get("ENDOTWIN_TRACEBACK"):
        traceback.print_exception(error)
    if _is_stop(error):
        return f"stopped{error if isinstance(error, KeyboardInterrupt) else ''}"
    if isinstance(error, ImportError):
        missing = error if isinstance(error, MissingExtraError) else missing_extra(error)
        if missing is not None:
            return str(missing)
        if _NO_MEMORY.search("".join(traceback.format_exception(error))):
            return "out of memory: a package cannot be loaded"
    if isinstance(error, MemoryError):
        return f"out of memory{f': {error}' if str(error) else ''}"
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    expected = isinstance(error, EXPECTED_ERRORS)
    if program := program_at_fault(error, expected=expected):
        return f"{program} (ENDOTWIN_TRACEBACK=1 shows where)"
    if expected:
        return str(error) or type(error).__name__
    fault = f"a fault of the program, please report it: {type(error).__name__}: {error}"
    return f"{fault} (ENDOTWIN_TRACEBACK=1 shows where)"
