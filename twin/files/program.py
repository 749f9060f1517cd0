"""Programs of the user: a Python file that is named on a command line is run, as `python FILE` would."""

import hashlib
import importlib.util
import re
import sys
import traceback
from pathlib import Path
from types import ModuleType

from twin.errors import EndoTwinError, InputError

_RUN: dict[str, str] = {}  # by the file of each program that has run: what it is, and its path as given


def run_program(path: Path, what: str) -> ModuleType:
    """Run a Python file, once in a process, and return it as a module under which its classes are pickled.

    `what` names it in errors. Raises `ValueError` where it does not exist or fails, with its line.
    """
    if path.suffix != ".py" or not path.is_file():
        raise InputError(f"{what} {path}: must be an existing Python file (.py)")
    file = path.resolve()
    name = f"{what.replace(' ', '_')}_{hashlib.sha256(str(file).encode()).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None  # a .py file has one
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    _RUN[str(file)] = f"{what} {path}"
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name], _RUN[str(file)]
        raise program_error(path, what, error) from error
    return module


def program_error(path: Path, what: str, error: Exception) -> InputError:
    """Return an error of a user's program in one line, with the line of the file that it comes from."""
    if isinstance(error, SyntaxError):
        line, reason = error.lineno, error.msg
    else:
        line, reason = _line_in(str(path.resolve()), error), str(error)
    reason = (reason.splitlines() or [""])[0][:200]
    if not isinstance(error, InputError):
        reason = f"{type(error).__name__}: {reason}"
    return InputError(f"{what} {path}{f', line {line}' if line else ''}: {reason}")


def program_at_fault(error: BaseException, *, expected: bool) -> str:
    """Return on one line which user's program an exception comes from, with its line; empty if from none.

    Where the exception is not `expected` and no line of a program is in its traceback, one that has run may
    still be the reason: its return value was invalid.
    """
    if isinstance(error, EndoTwinError):
        return ""
    reason = f"{type(error).__name__}: {error}"
    for file, program in _RUN.items():
        if line := _line_in(file, error):
            return f"{program}, line {line}: {reason}"
    if expected or not _RUN:
        return ""
    return f"a fault of the {' or '.join(_RUN.values())}, or of EndoTwin: {reason}"


def _line_in(file: str, error: BaseException) -> int | None:
    """Return the last line of a file in the traceback of an error, that of a worker process included."""
    found = re.findall(rf'File "{re.escape(file)}", line (\d+)', "".join(traceback.format_exception(error)))
    return int(found[-1]) if found else None
