"""The end of a command: its one line, its exit status, and the signals that stop it.

Whatever a command was given, it ends in a summary on stdout, or in one line on stderr that is no longer than
`LONGEST_LINE`. Set ENDOTWIN_TRACEBACK=1 to see where an error comes from.
"""

import contextlib
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from types import FrameType
from typing import Any, TextIO

from twin.errors import MissingExtraError, missing_extra

MISTAKE = 2
"""Exit status where something cannot be done."""
LONGEST_LINE = 300
"""Characters of the line that says why."""
TOLD = (ValueError, OSError, ArithmeticError, MemoryError, BrokenExecutor)
"""Errors whose text is for the user; any other is a fault of the program."""

_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Stopped(KeyboardInterrupt):
    """A signal that asks the command to end: it cleans up behind itself."""


class _Signal:
    """The signal that has asked for the end, if one has, and whether it waits for the end of a step."""

    number: int | None = None
    waits = False


class WholeStep:
    """Context manager: a signal that comes within the block ends the command behind it, not in its middle."""

    def __enter__(self) -> None:
        """Let signals wait."""
        _Signal.waits = True

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Let them end the command again; raise what has come meanwhile.

        Raises:
            Stopped: a signal came within the block, which ended well.
        """
        _Signal.waits = False
        if _Signal.number is not None and kind is None:
            raise Stopped


def leave_at_once(number: int, frame: FrameType | None = None) -> None:
    """Handle a signal before a verb begins its work: nothing is open yet, and no library is whole."""
    with contextlib.suppress(OSError):
        os.write(2, b"endotwin: stopped\n")
    os._exit(128 + number)


@contextlib.contextmanager
def stop_at_once() -> Iterator[None]:
    """Context manager: signals end the command at once, as long as it only starts."""
    with _handled_by(leave_at_once):
        yield


@contextlib.contextmanager
def stop_by_signals() -> Iterator[None]:
    """Context manager: a signal ends the block by an exception, so that it cleans up; a second, at once."""
    _Signal.number, _Signal.waits = None, False
    hook, sys.unraisablehook = sys.unraisablehook, _deliver_again
    try:
        with _handled_by(_stop):
            yield
    finally:
        sys.unraisablehook = hook


@contextlib.contextmanager
def _handled_by(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():  # Python handles signals there alone
        yield
        return
    before = {number: signal.signal(number, handler) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


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


def exit_status(error: BaseException) -> int:
    """Return the exit status for an exception that ends a command."""
    return 128 + (_Signal.number or signal.SIGINT) if _is_stop(error) else MISTAKE


def _is_stop(error: BaseException) -> bool:
    """Return whether a signal is behind an exception: libraries may have made another one of it."""
    return isinstance(error, KeyboardInterrupt) or _Signal.number is not None


def described(error: BaseException) -> str:
    """Return in words why a command ends, on one line."""
    if os.environ.get("ENDOTWIN_TRACEBACK"):
        traceback.print_exception(error)
    if _is_stop(error):
        return f"stopped{error if isinstance(error, KeyboardInterrupt) else ''}"
    if isinstance(error, ImportError):
        missing = error if isinstance(error, MissingExtraError) else missing_extra(error)
        if missing is not None:
            return str(missing)
    if isinstance(error, MemoryError):
        return f"out of memory{f': {error}' if str(error) else ''}"
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, TOLD):
        return str(error) or type(error).__name__
    fault = f"a fault of the program, please report it: {type(error).__name__}: {error}"
    return f"{fault} (ENDOTWIN_TRACEBACK=1 shows where)"


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
    """Print text on stdout or another stream; where its reader has gone, nothing is said.

    Returns:
        Whether it could be written, or nobody reads it.
    """
    try:
        print(text, file=stream or sys.stdout, flush=True)
    except BrokenPipeError:
        _discard_stdout()
    except (OSError, ValueError):  # a full disk, a closed file
        _discard_stdout()
        return False
    return True


def say_at_once(line: str) -> bool:
    """Write one line of a stream to stdout, and wait until its reader has taken it.

    Returns:
        False where the reader has gone.

    Raises:
        OSError: it cannot be written, as on a full disk.
    """
    try:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        _discard_stdout()
        return False
    return True


def flush_stdout() -> None:
    """Write what is left for stdout, where it has a reader."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        _discard_stdout()


def _discard_stdout() -> None:
    """Send what is left in the buffer of stdout nowhere: Python would try once more, and complain."""
    with contextlib.suppress(OSError, ValueError, io.UnsupportedOperation):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def prepare_streams() -> None:
    """Make stdout and stderr fit to be written to: open, and without characters that they cannot show."""
    with contextlib.suppress(OSError):
        while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
            pass  # one that was closed: the next file would be taken for it
        os.close(descriptor)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115  open as long as the process
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
